"""Campaigns on disk: a manifest, shards of rows, one lock. The only place that knows Parquet."""

from sim.storage.campaign_folder import CampaignFolder, Damage, need_arrow, need_free
from sim.storage.errors import (
    DamagedError,
    DiskFullError,
    ManifestError,
    MissingLibraryError,
    OccupiedError,
    StorageError,
)
from sim.storage.manifest import MOST_CELLS, Axis, Manifest, read_manifest

__all__ = [
    "MOST_CELLS",
    "Axis",
    "CampaignFolder",
    "Damage",
    "DamagedError",
    "DiskFullError",
    "Manifest",
    "ManifestError",
    "MissingLibraryError",
    "OccupiedError",
    "StorageError",
    "need_arrow",
    "need_free",
    "read_manifest",
]
