"""States of spacecraft and objects from orbit ephemeris messages (OEM)."""
