"""Signals of simulated scenes for the studies of the codec: a modelled hand explores what a robot would touch.

`signals` runs hand and scene, `catalogue` names the scenes, `exploration` draws where the hand goes, `charts` says
where a surface is.
"""

from weberlink.studies.evaluate.scenes.signals import scene_names, scene_signal, scene_signals

__all__ = ["scene_names", "scene_signal", "scene_signals"]
