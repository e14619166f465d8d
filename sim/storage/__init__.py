"""Campaigns on disk: a manifest, shards of rows, one lock. The only package that knows Parquet and pydantic."""

from sim.storage.campaign_folder import CampaignFolder, Damage, need_arrow
from sim.storage.campaign_writer import CampaignWriter, need_free
from sim.storage.codec import fingerprint
from sim.storage.files import (
    DamagedError,
    DiskFullError,
    ManifestError,
    MissingLibraryError,
    OccupiedError,
    StorageError,
)
from sim.storage.manifest import MANIFEST, MAX_CELLS, Axis, Manifest, read_manifest

__all__ = [
    "MANIFEST",
    "MAX_CELLS",
    "Axis",
    "CampaignFolder",
    "CampaignWriter",
    "Damage",
    "DamagedError",
    "DiskFullError",
    "Manifest",
    "ManifestError",
    "MissingLibraryError",
    "OccupiedError",
    "StorageError",
    "fingerprint",
    "need_arrow",
    "need_free",
    "read_manifest",
]
