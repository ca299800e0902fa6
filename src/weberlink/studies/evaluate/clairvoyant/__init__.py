"""The fewest sends that any encoder of a family of predictors could make, were the whole signal known to it.

`clairvoyant_sends` says it for a recorded force. It is a lower bound: what the real encoder sends, or an encoder that
chose its moments and real-valued model parameters with knowledge of the future, is never less.

Between two sends one model of the family must keep the law of the deadband at every tick. What a model can explain
of a stretch of ticks it can explain of any part of that stretch, so sending as late as possible is best, and all
that is needed is how far a send at each tick can reach (`stretch`). `demand` is what the law asks of a tick, `linear`
and `surface` are what the families can do, `bound` puts them together.

How tight it is:

- One degree of freedom: exact for hold and line, and for the plane but that its stiffness has no least value. There a
  model lies on the line of the signal: what is beside it no sample of the signal can say. Of a sphere only the
  stiffness and the side of its centre on which it pushes are asked, and of a convex one nothing without contact.
- More: relaxed. Hold and line are asked direction by direction, so the deadband's ball counts as the polygon around
  it (2 % wider with two axes of force, 13 % with three) and each direction has its own line. Surfaces are asked pair by
  pair of ticks; `surface` says what that leaves out.
- Shapes of the deadband: where magnitude and direction are kept apart, hold and line are asked for the convex hull of
  the piece of shell that is left, direction by direction, and surfaces for its magnitudes and its cone. With one degree
  of freedom the cone is the ball again. A velocity-adaptive deadband is a ball of another radius at every tick. Where
  the Weber factor scales what was displayed or sent, nothing is said (None), nor of predictors that are not these.
- Stretches of more than 32 ticks, or 256 with one degree of freedom: ticks that far apart are compared on a grid of
  time, the coarser the further, so that a stretch may seem longer than it is.
- Ticks whose deadband reaches the edge of the wire's range ask nothing of a model that extrapolates, which the decoder
  saturates there. A surface is not asked at the tick of its own send, where the decoder says the sample itself.
"""

from weberlink.studies.evaluate.clairvoyant.bound import clairvoyant_sends

__all__ = ["clairvoyant_sends"]
