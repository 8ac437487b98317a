"""Measures of `walk bench` add up; no test here fails on a time."""

from dataclasses import replace

import pytest

from app.bench import bench, solvers, table
from app.bench.bench import PLANNING
from app.bench.solvers import compare, problems_of
from walkcore import load_scenario
from walkcore.mpc.preview import FOOTHOLD_SCALE
from walkcore.mpc.qp import SOLVERS, InteriorPointSolver
from walkcore.stages import UNTIMED

SHORT = replace(load_scenario("herdt-2010-section-6"), duration=1.2, events=())


@pytest.fixture(scope="module")
def result():
    return bench(report=lambda _: None, motion=SHORT, steady_ticks=200)


def test_the_stages_of_a_tick_add_up(result):
    planning, moving = (
        {"gait", *PLANNING, "snapshot"},
        {"dynamic_filter", "swing_foot", "inverse_kinematics", "true_cop"},
    )
    assert set(result.stages) == planning | moving
    assert sum(stage.max for stage in result.stages.values()) >= result.tick.max
    assert result.tick.median >= max(stage.median for stage in result.stages.values())


def test_the_solver_and_what_is_around_it_add_up(result):
    assert 0.0 < result.solver_itself.median < result.assemble_and_solve.median
    assert 0.0 < result.around_solver.median < result.assemble_and_solve.median
    assert result.assemble_and_solve.max <= result.solver_itself.max + result.around_solver.max


def test_all_solvers_solve_the_same_qps_to_within_a_millimetre(result):
    assert set(result.solvers) == {*SOLVERS, "quadprog"}
    for solver in result.solvers.values():
        assert solver.foothold_error_max < 1.0
        assert 0.0 < solver.duration.median <= solver.duration.p99 <= solver.duration.max


def test_a_solver_that_is_wrong_shows(monkeypatch):
    class Lazy(InteriorPointSolver):
        def solve(self, problem, stages=UNTIMED):
            solution = super().solve(problem, stages)
            return replace(solution, u=solution.u + 1e-3 / FOOTHOLD_SCALE)

    monkeypatch.setattr(solvers, "SOLVERS", SOLVERS | {"lazy": Lazy})
    results = compare(problems_of(SHORT.without_body(), 10), SHORT.parameters.horizon_samples)
    assert results["piqp"].foothold_error_max < 1e-2
    assert results["lazy"].foothold_error_max == pytest.approx(1.0, rel=0.01)


def test_the_point_mass_walks_steadily_with_every_solver(result):
    assert {(w.walk, w.solver) for w in result.steady_walks} == {
        (walk, solver) for walk in ("straight", "circle") for solver in SOLVERS
    }
    for walk in result.steady_walks:
        assert 0.0 < walk.assemble_and_solve.median < walk.step.median
        assert 0.0 < walk.fastest.median <= walk.assemble_and_solve.median
        assert walk.fastest.max <= walk.assemble_and_solve.max


def test_the_table_shows_all_of_it(result):
    text = table(result)
    for name in (*result.stages, *result.solvers, "assemble + solve", "around the solver", "circle", "with the body"):
        assert name in text


def test_the_mapping_holds_the_same(result):
    mapping = result.to_mapping()
    assert mapping["stages"]["solve"]["median"] == result.stages["solve"].median
    assert mapping["around_solver"]["median"] == result.around_solver.median
    assert [speed["real_time_factor"] > 0.0 for speed in mapping["speeds"]] == [True] * 4


def test_recoveries_are_ticks_of_their_own_whose_planning_is_a_share(result):
    assert 0.0 < result.recovering_planning.median < result.recovering_tick.median
    assert result.recovering_planning.median > result.assemble_and_solve.median
    assert result.recovering_fastest.p99 <= result.recovering_planning.p99
    assert "recovering" in table(result)
