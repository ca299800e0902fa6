"""What the geometry predictors share: the question whether two samples belong to one contact."""

from weberlink.codec.sample import Sample
from weberlink.geometry.vector import ZERO


def same_contact(newest: Sample, previous: Sample) -> bool:
    """Whether both samples touch: a contact starts at the first sample with a force after one without."""
    return ZERO not in (newest.value, previous.value)
