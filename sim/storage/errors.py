"""What can go wrong with a campaign's folder; each message says what, where, and what to do."""

from __future__ import annotations


class StorageError(Exception):
    """A campaign's folder cannot be used as asked."""


class MissingLibraryError(StorageError):
    """The library that reads and writes campaigns is not installed."""


class OccupiedError(StorageError):
    """The folder holds something else, or another campaign is at work in it."""


class ManifestError(StorageError):
    """The manifest is no manifest, or that of another campaign."""


class DamagedError(StorageError):
    """A shard is no longer what was written."""


class DiskFullError(StorageError):
    """There is no room left; what was written before is whole."""
