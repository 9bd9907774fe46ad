"""Scenes: characters, objects and events; live, recorded and measured."""

from kumite.lazy import names_of

__getattr__, __dir__ = names_of(__name__, __file__)
