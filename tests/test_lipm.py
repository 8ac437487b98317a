import numpy as np
import pytest

from walkcore.mpc.lipm import CoMState, Pendulum, preview_matrices

HEIGHT, GRAVITY = 0.814, 9.81
PENDULUM = Pendulum(HEIGHT, GRAVITY)


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.mark.parametrize("first", [0.1, 0.005, 0.063])
def test_preview_equals_stepwise_integration(rng, first):
    intervals = np.array([first, *[0.1] * 15])
    preview = preview_matrices(intervals, PENDULUM)
    com = CoMState(rng.normal(size=(3, 2)))
    jerks = rng.normal(size=(16, 2))
    state = com
    for i, (jerk, duration) in enumerate(zip(jerks, intervals, strict=True)):
        state = state.integrated(jerk, duration)
        assert np.allclose(preview.Pps[i] @ com.matrix + preview.Ppu[i] @ jerks, state.position, atol=1e-12)
        assert np.allclose(preview.Pvs[i] @ com.matrix + preview.Pvu[i] @ jerks, state.velocity, atol=1e-12)
        assert np.allclose(preview.Pzs[i] @ com.matrix + preview.Pzu[i] @ jerks, PENDULUM.cop(state), atol=1e-12)
        assert np.allclose(preview.Pds[i] @ com.matrix + preview.Pdu[i] @ jerks, PENDULUM.dcm(state), atol=1e-12)
        expected = (state.position, PENDULUM.dcm(state), PENDULUM.cop(state))
        assert np.allclose([points[i] for points in preview.trajectories(com, jerks)], expected, atol=1e-12)


def test_equal_intervals_give_the_matrices_printed_in_the_paper():
    T, N, h_g = 0.1, 16, HEIGHT / GRAVITY
    preview = preview_matrices(np.full(N, T), PENDULUM)
    n = np.arange(1, N + 1)
    assert np.allclose(preview.Pzs, np.column_stack([np.ones(N), n * T, (n * T) ** 2 / 2 - h_g]))
    ago = np.subtract.outer(n, n)  # samples between a jerk's interval and the one it is felt at
    lower = ago >= 0
    assert np.allclose(preview.Ppu, np.where(lower, (1 + 3 * ago + 3 * ago**2) * T**3 / 6, 0.0))
    assert np.allclose(preview.Pvu, np.where(lower, (1 + 2 * ago) * T**2 / 2, 0.0))
    assert np.allclose(preview.Pzu, np.where(lower, (1 + 3 * ago + 3 * ago**2) * T**3 / 6 - T * h_g, 0.0))


def test_integration_over_two_halves_is_integration_over_the_whole(rng):
    com, jerk = CoMState(rng.normal(size=(3, 2))), rng.normal(size=2)
    halves = com.integrated(jerk, 0.05).integrated(jerk, 0.05)
    assert np.allclose(halves.matrix, com.integrated(jerk, 0.1).matrix, atol=1e-14)


def test_a_push_changes_the_velocity_only(rng):
    com = CoMState(rng.normal(size=(3, 2)))
    pushed = com.pushed(np.array([0.1, -0.2]))
    assert np.allclose(pushed.velocity - com.velocity, [0.1, -0.2])
    assert np.array_equal(PENDULUM.cop(pushed), PENDULUM.cop(com))


def test_a_state_is_a_copy_that_nobody_can_write_to():
    position = np.zeros(2)
    com = CoMState.at_rest(position)
    position[0] = 1.0
    assert com.position[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        com.position[0] = 1.0
    with pytest.raises(ValueError, match="shape"):
        CoMState(np.zeros((3, 3)))
