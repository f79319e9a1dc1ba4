"""The files of a build: a folder of all of them, or those asked for, each whole or not at all."""

from phexfab.delivery.folder import deliver
from phexfab.delivery.formats import FORMATS, SUFFIXES, export

__all__ = ["FORMATS", "SUFFIXES", "deliver", "export"]
