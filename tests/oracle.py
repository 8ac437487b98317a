"""The walking QP rebuilt from a recording and its run.json alone, and solved exactly by another solver.

Independent of walkcore on purpose: matrices by stepwise integration, polygons edge by
edge, quadprog instead of PIQP. What both agree on is the paper's.
"""

import math

import numpy as np
import quadprog

STANDING = 0


class Oracle:
    """One run: `parameters` of run.json and the columns of the recording."""

    def __init__(self, parameters, columns):
        self.p, self.c = parameters, columns
        self.T, self.dt, self.N = (parameters[k] for k in ("sampling_period", "control_period", "horizon_samples"))

    def __getitem__(self, name):
        return self.c[name]

    def intervals(self, k):
        ticks = round(self.T / self.dt)
        left = self["time_to_touchdown"][k]
        first = ticks - int(self["tick"][k]) % ticks if math.isnan(left) else (round(left / self.dt) - 1) % ticks + 1
        first *= self.dt
        return [first] + [self.T] * (self.N - 1)

    def matrices(self, k):
        """Velocity and CoP at the samples, as affine functions of the jerks of one axis: by integration."""
        h_g = self.p["com_height"] / self.p["gravity"]
        state = np.hstack([np.eye(3), np.zeros((3, self.N))])  # state as a function of (x, u)
        velocity, cop = [], []
        for i, T in enumerate(self.intervals(k)):
            A = np.array([[1, T, T * T / 2], [0, 1, T], [0, 0, 1]])
            state = A @ state
            state[:, 3 + i] += [T**3 / 6, T**2 / 2, T]
            velocity.append(state[1].copy())
            cop.append(state[0] - h_g * state[2])
        return np.array(velocity), np.array(cop)

    def stances(self, k):
        """Stance of each sample of tick k: "pair" (the feet where they are), or the number of a foothold, or both
        ("after", number) where that foothold and the one that ends a stop stand side by side."""
        first = self.intervals(k)[0]
        if math.isnan(self["time_to_touchdown"][k]):
            return ["pair"] * self.N
        steps_left = int(self["steps_to_stand"][k])
        touchdown = self["time_to_touchdown"][k]
        step_start = touchdown - self["step_duration"][k]  # of the step under way or to come
        found = []
        for i in range(self.N):
            t = first + i * self.T
            step = max(1 + math.floor((t - touchdown - 1e-6) / self["next_step_duration"][k]), 0)
            step = -1 if t < step_start + 1e-6 else step
            if step < 0:
                found.append("pair")
            elif 0 <= steps_left <= step:
                found.append(("after", steps_left - 1))
            else:
                found.append(step)
        assert self["samples_on_support"][k] == sum(stance == 0 for stance in found)
        return found

    def supports(self, k):
        """For each sample: (known centre or offset, foothold it stands on or None, polygon relative to the centre)."""
        p, margin = self.p, self.p["cop_margin"]
        side = int(self["support_side"][k])
        support = np.array([self["support_x"][k], self["support_y"][k]])
        yaws = self.yaws(k)
        left, right = ([self[f"{f}_x"][k], self[f"{f}_y"][k], self[f"{f}_yaw"][k]] for f in ("left", "right"))
        found = []
        for stance in self.stances(k):
            if stance == "pair":
                middle = (np.array(left[:2]) + right[:2]) / 2
                corners = np.vstack([self.sole(0, left) - middle, self.sole(1, right) - middle])
                found.append((middle, None, edges(corners, margin)))
                continue
            stands_on_both, step = (True, stance[1]) if isinstance(stance, tuple) else (False, stance)
            foot_side, yaw = (side + step) % 2, yaws[step]
            outline, offset = self.sole(foot_side, (0.0, 0.0, yaw)), np.zeros(2)
            if stands_on_both:
                across = p["stance_width"] * (-1 if foot_side == 0 else 1)
                to_other = across * np.array([-math.sin(yaw), math.cos(yaw)])
                other = self.sole(1 - foot_side, (*to_other, yaw))
                outline, offset = np.vstack([outline, other]) - to_other / 2, to_other / 2
            centre = support + offset if step == 0 else offset
            found.append((centre, step - 1 if step else None, edges(outline, margin)))
        return found

    def yaws(self, k):
        """Yaws of the support foot and the footholds to come."""
        return [self[f"{name}_yaw"][k] for name in ("support", "foothold", "foothold2", "foothold3", "foothold4")]

    def sole(self, side, place):
        x, y, yaw = place
        outline = np.array(self.p["sole"]["polygon"]) * [1, 1 - 2 * side]
        c, s = math.cos(yaw), math.sin(yaw)
        return np.array([x, y]) + outline @ np.array([[c, s], [-s, c]])

    def problem(self, k):
        """P, q, G, h of: minimise 1/2 u'Pu + q'u, G u <= h, with u = (jerk x, foot x, jerk y, foot y)."""
        p, N = self.p, self.N
        V, Z = self.matrices(k)
        supports = self.supports(k)
        m = max((foot + 1 for _, foot, _ in supports if foot is not None), default=0)
        n = N + m
        x = np.array([[self[f"com_{d}{a}"][k] for a in "xy"] for d in ("", "v", "a")])
        heading = (self["left_yaw"][k] + self["right_yaw"][k]) / 2
        times = np.cumsum(self.intervals(k))
        c, s = (f(heading + self["reference_yaw_rate"][k] * times) for f in (np.cos, np.sin))
        vx, vy = self["reference_vx"][k], self["reference_vy"][k]
        reference = np.column_stack([c * vx - s * vy, s * vx + c * vy])

        P, q = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
        P[:N, :N] += p["alpha"] * np.eye(N)
        P[n : n + N, n : n + N] += p["alpha"] * np.eye(N)
        G, h = [], []
        for a in (0, 1):
            at = a * n
            for i in range(N):
                row = np.zeros(2 * n)
                row[at : at + N] = V[i, 3:]
                P += p["beta"] * np.outer(row, row)
                q += p["beta"] * row * (V[i, :3] @ x[:, a] - reference[i, a])
        relative = []  # CoP minus the centre of its support: rows and offset, for x and y
        for i, (centre, foot, _) in enumerate(supports):
            rows, offset = np.zeros((2, 2 * n)), np.zeros(2)
            for a in (0, 1):
                rows[a, a * n : a * n + N] = Z[i, 3:]
                offset[a] = Z[i, :3] @ x[:, a] - centre[a]
                if foot is not None:
                    rows[a, a * n + N + foot] = -1
                P += p["gamma"] * np.outer(rows[a], rows[a])
                q += p["gamma"] * rows[a] * offset[a]
            relative.append((rows, offset))
        for (rows, offset), (_, _, polygon) in zip(relative, supports, strict=True):
            for normal, bound in polygon:
                G.append(normal @ rows)
                h.append(bound - normal @ offset)
        self.foothold_rows(k, m, n, G, h)
        return P, q, np.array(G), np.array(h), m

    def region(self, yaw, landing_is_right):
        """Region of a foothold in the frame of the support foot, for its yaw against that foot."""
        mirror = -1 if landing_is_right else 1
        toes_out = yaw * mirror
        bands = self.p["foothold_regions"]
        band = min(bands, key=lambda band: max(band["yaw"][0] - toes_out, toes_out - band["yaw"][1], 0.0))
        return np.array(band["region"]) * [1, mirror]

    def foothold_rows(self, k, m, n, G, h):
        p, N, side = self.p, self.N, int(self["support_side"][k])
        previous, yaws = None, self.yaws(k)
        for foot in range(m):
            landing_is_right = (side + foot) % 2 == 0
            region = self.region(yaws[foot + 1] - yaws[foot], landing_is_right)
            c, s = math.cos(yaws[foot]), math.sin(yaws[foot])
            for normal, bound in edges(region @ np.array([[c, s], [-s, c]]), 0.0):
                row = np.zeros(2 * n)
                for a in (0, 1):
                    row[a * n + N + foot] = normal[a]
                    if previous is not None:
                        row[a * n + N + previous] = -normal[a]
                    else:
                        bound += normal[a] * self["support_" + "xy"[a]][k]
                G.append(row)
                h.append(bound)
            previous = foot
        if m:
            swing = ("left", "right")[1 - side]
            foot = np.array([self[f"{swing}_x"][k], self[f"{swing}_y"][k]])
            c, s = math.cos(yaws[0]), math.sin(yaws[0])
            for axis, limit in zip(((c, s), (-s, c)), p["max_foot_speed"], strict=True):
                for sign in (1, -1):
                    row = np.zeros(2 * n)
                    row[N], row[n + N] = sign * axis[0], sign * axis[1]
                    G.append(row)
                    h.append(self["time_to_touchdown"][k] * limit + sign * np.dot(axis, foot))

    def footholds(self, k):
        """The exact optimum's footholds at tick k, shape (m, 2), and the jerks, shape (N, 2)."""
        P, q, G, h, m = self.problem(k)
        n = self.N + m
        scale = np.tile(np.repeat([1.0, 1e3], [self.N, m]), 2)
        scaled = 1e6 * P * scale * scale[:, None]
        u = quadprog.solve_qp(scaled, -1e6 * q * scale, -(G * scale).T, -h)[0] * scale
        axes = u.reshape(2, n)
        return axes[:, self.N :].T, axes[:, : self.N].T


def hull(points):
    """Corners of the convex hull, counter-clockwise (Andrew's monotone chain)."""
    points = sorted(map(tuple, points))

    def half(sequence):
        chain = []
        for point in sequence:
            while len(chain) > 1 and cross(chain[-2], chain[-1], point) <= 1e-15:
                chain.pop()
            chain.append(point)
        return chain[:-1]

    return np.array(half(points) + half(reversed(points)))


def cross(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def edges(corners, margin):
    """(outward normal, bound) of each edge of a convex polygon, whichever way round it is listed."""
    corners = hull(corners)
    rows = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([b[1] - a[1], a[0] - b[0]]) / np.hypot(*(b - a))
        rows.append((normal, normal @ a - margin))
    return rows


def excess(point, corners, margin=0.0):
    """Distance of a point from a convex polygon; negative inside."""
    return max(normal @ point - bound for normal, bound in edges(corners, margin))
