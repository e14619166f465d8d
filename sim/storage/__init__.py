"""Campaigns on disk: a manifest, files of runs, one lock. The only package that knows Parquet and
pydantic.
"""

from infoset.sim.storage.campaign_folder import CampaignFolder, need_free
from infoset.sim.storage.codec import fingerprint
from infoset.sim.storage.files import StorageError
from infoset.sim.storage.manifest import MANIFEST, MAX_CELLS, Axis, Manifest, read_manifest

__all__ = [
    "MANIFEST",
    "MAX_CELLS",
    "Axis",
    "CampaignFolder",
    "Manifest",
    "StorageError",
    "fingerprint",
    "need_free",
    "read_manifest",
]
