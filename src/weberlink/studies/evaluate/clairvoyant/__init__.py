"""Lower bound on the sends of any encoder of a predictor family, even one that knows the whole signal.

Between two sends, one model of the family must keep the decoded force within the deadband at every tick. A model that
explains a stretch of ticks explains every part of it, so sending as late as possible is optimal. It remains to compute
how far a send at each tick can reach (`stretch`), from the condition at each tick (`demand`).

Tightness:

- One degree of freedom: exact for hold and line, and for the plane except that its stiffness has no least value. For a
  sphere, only the stiffness and the side of its centre are checked.
- More degrees of freedom: relaxed. Hold and line are checked direction by direction, so the ball of the deadband is
  replaced by the polyhedron around it (2 % wider with two axes of force, 13 % with three) and each direction has its
  own line. Surfaces are checked for pairs of ticks; `surface` says what that leaves out.
- Deadbands with separate magnitude and direction: hold and line use the convex hull of the allowed shell, surfaces its
  magnitudes and its cone. A velocity-adaptive deadband is a ball with another radius at every tick. The result is None
  if the Weber factor scales the displayed or the sent force, and for other predictors.
- Stretches over 32 ticks (256 with one degree of freedom): distant ticks are compared on a grid of time, which gets
  coarser with the distance, so a stretch may seem longer than it is.
- Ticks whose deadband reaches the limit of the wire put no condition on models that extrapolate, because the decoder
  saturates. A surface is not checked at the tick of its own send, where the decoder outputs the sample.
"""

from weberlink.studies.evaluate.clairvoyant.bound import clairvoyant_sends

__all__ = ["clairvoyant_sends"]
