"""The version of msahl."""

VERSION = "0.1.0"
