"""Yaws of the coming footsteps, decided before the QP so that it stays linear (section 4)."""

from walkcore.values import Vector, read_only


def foothold_yaws(support_yaw: float, nb_footholds: int) -> Vector:
    """Yaw of each foothold to come in the world frame [rad], shape (m,): the support foot's."""
    return read_only([support_yaw] * nb_footholds)
