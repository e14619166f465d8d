"""What the pages of a Parquet file claim to hold, read from their headers before anything is unpacked."""

from __future__ import annotations

DEEPEST = 8
_WIDEST = 10
_STOP, _TRUE, _FALSE, _BYTE, _I16, _I32, _I64, _DOUBLE, _BINARY, _, _, _, _STRUCT = range(13)

_UNCOMPRESSED, _COMPRESSED = (2,), (3,)
_DICTIONARY, _DATA, _DATA_2 = 7, 5, 8
_ENCODING = {_DICTIONARY: (7, 2), _DATA: (5, 2), _DATA_2: (8, 4)}
_VALUES = {_DATA: (5, 1), _DATA_2: (8, 1)}
_PLAIN_OR_CODED = (0, 2, 3, 4, 8)
"""Plain, dictionary, run lengths, bits: encodings in which a value takes no more than itself or an entry."""


def claimed_bytes(content: bytes, first: int, size: int, rows: int) -> int:
    """Return how many bytes the pages of a column say that they come to.

    Parameters
    ----------
    content : bytes
        The file.
    first, size : int
        Where the column's pages lie, bytes.
    rows : int
        How many values they must have.

    Returns
    -------
    int

    Raises
    ------
    ValueError
        If there are no pages one after the other with so many values.

    Notes
    -----
    Each page is a header, a `PageHeader` in Thrift's compact protocol, and as many bytes as it says. A reader makes
    room for the size it claims to have uncompressed, whatever the footer says. O(pages).
    """
    if not 0 <= first <= first + size <= len(content):
        raise ValueError("a column lies outside the file")
    claimed, values, end = 0, 0, first + size
    while first < end:
        header = _Header(content, first, end)
        says = header.whole_numbers()
        uncompressed, compressed = says.get(_UNCOMPRESSED, -1), says.get(_COMPRESSED, -1)
        if uncompressed < 0 or not 0 <= compressed <= end - header.at:
            raise ValueError("a page has no size, or lies outside its column")
        encodings = [says[path] for path in _ENCODING.values() if path in says]
        if len(encodings) != 1 or encodings[0] not in _PLAIN_OR_CODED:
            raise ValueError("a page is encoded as no campaign is")
        counts = [says[path] for path in _VALUES.values() if path in says]
        if min(counts, default=0) < 0:
            raise ValueError("a page has fewer values than none")
        claimed, values, first = claimed + uncompressed, values + sum(counts), header.at + compressed
    if values != rows:
        raise ValueError("the pages of a column have other lengths than it says")
    return claimed


class _Header:
    """A struct of Thrift's compact protocol."""

    def __init__(self, content: bytes, at: int, end: int) -> None:
        self._content = content
        self._end = end
        self.at = at

    def whole_numbers(self) -> dict[tuple[int, ...], int]:
        """Return the whole numbers of the struct that begins here, by the path of their field; step over all else."""
        found: dict[tuple[int, ...], int] = {}
        self._struct((), found)
        return found

    def _struct(self, path: tuple[int, ...], found: dict[tuple[int, ...], int]) -> None:
        if len(path) > DEEPEST:
            raise ValueError("a page's header is nested too deeply")
        field = 0
        while (head := self._byte()) & 0x0F != _STOP:
            field = field + (head >> 4) if head >> 4 else self._zigzag()
            kind, here = head & 0x0F, (*path, field)
            if here in found:
                raise ValueError("a page's header says something twice")
            if kind in (_I16, _I32, _I64):
                found[here] = self._zigzag()
            elif kind == _STRUCT:
                self._struct(here, found)
            elif kind in (_BYTE, _DOUBLE):
                self._step(1 if kind == _BYTE else 8)
            elif kind == _BINARY:
                self._step(self._varint())
            elif kind not in (_TRUE, _FALSE):  # flags are in the head; a page's header has no lists, sets or maps
                raise ValueError("a page's header is none")

    def _byte(self) -> int:
        self._step(1)
        return self._content[self.at - 1]

    def _step(self, size: int) -> None:
        self.at += size
        if self.at > self._end:
            raise ValueError("a page's header is cut short")

    def _varint(self) -> int:
        value = 0
        for place in range(_WIDEST):
            byte = self._byte()
            value |= (byte & 0x7F) << 7 * place
            if byte < 0x80:
                return value
        raise ValueError("a page's header holds too great a number")

    def _zigzag(self) -> int:
        value = self._varint()
        return (value >> 1) ^ -(value & 1)
