"""Cached results of a method end with its object, without the garbage collector."""

import gc
from weakref import ref

import pytest

from walkcore import Command, Parameters, Reference, Simulation, load_robot
from walkcore.cache import instance_cache
from walkcore.mpc.pattern_generator import PatternGenerator
from walkcore.mpc.supports import SupportGeometry


class Squares:
    def __init__(self) -> None:
        self.computed: list[int] = []
        self.of = instance_cache(self._compute, 2)

    def _compute(self, number: int) -> int:
        self.computed.append(number)
        return number**2


@pytest.fixture
def _without_collector():
    gc.disable()
    yield
    gc.enable()


def test_results_are_cached_until_others_take_their_place():
    squares = Squares()
    assert [squares.of(number) for number in (3, 3, 4, 3, 5, 4)] == [9, 9, 16, 9, 25, 16]
    assert squares.computed == [3, 4, 5, 4]


@pytest.mark.usefixtures("_without_collector")
def test_an_object_and_its_cached_results_end_with_its_last_user():
    squares = Squares()
    squares.of(3)
    is_there = ref(squares)
    del squares
    assert is_there() is None


@pytest.mark.usefixtures("_without_collector")
def test_a_change_of_parameters_leaves_nothing_of_the_old_ones():
    def count():
        return [
            sum(isinstance(thing, kind) for thing in gc.get_objects()) for kind in (PatternGenerator, SupportGeometry)
        ]

    simulation = Simulation(load_robot("hrp2"))
    for _ in range(300):
        simulation.step(Command(Reference(vx=0.2)))
    before = count()
    simulation.change(Parameters(beta=1.1))
    simulation.step(Command(Reference(vx=0.2)))
    assert count() == before
