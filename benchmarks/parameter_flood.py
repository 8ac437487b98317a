"""Late ticks while one client changes parameters as fast as it gets responses.

    python benchmarks/parameter_flood.py --seconds 20

For each kind of change, a server of its own and a robot that walks: how many changes were made, how many ticks
started late, and the latest of all. The first kind is no change at all, for comparison.
"""

import itertools
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import httpx
import tyro
from deadlines import REFERENCE, SETTLE, server

PATIENCE = 60.0  # [s] for a response
KINDS: Mapping[str, tuple[Mapping[str, Any], ...]] = {
    "nothing": (),
    "empty": ({},),
    "alpha": ({"alpha": 1e-6}, {"alpha": 2e-6}),
    "cop_margin": tuple({"cop_margin": 0.02 + 1e-4 * i} for i in range(100)),
    "step_duration": ({"step_duration": 0.8}, {"step_duration": 1.0}),
    "scheme": ({"scheme": "full"}, {"scheme": "adapted_steps"}),
    "daqp": ({"solver": "daqp", "horizon_samples": 35, "scheme": "adapted_steps"}, {"scheme": "full"}),
}


@dataclass(frozen=True)
class ParameterFlood:
    """Floods to try."""

    seconds: float = 20.0
    """Duration of each."""
    kinds: tuple[str, ...] = tuple(KINDS)
    """Names of `KINDS`."""
    robot: str = "talos"


def main(chosen: ParameterFlood) -> None:
    """Print a row for each kind."""
    print("        change responses   made  ticks  >5 ms >50 ms    latest factor")
    for kind in chosen.kinds:
        with server(chosen.robot) as url, httpx.Client(base_url=f"{url}api/v1/", timeout=PATIENCE) as api:
            api.put("live/reference", json=REFERENCE).raise_for_status()
            time.sleep(SETTLE)
            print(f"{kind:>14} {flooded(api, KINDS[kind], chosen.seconds)}", flush=True)


def flooded(api: httpx.Client, changes: tuple[Mapping[str, Any], ...], seconds: float) -> str:
    """The measures of one flood, in columns."""
    first = api.get("live").json()
    began = time.monotonic()
    nb_responses = nb_made = 0
    for change in itertools.cycle(changes or (None,)):
        if time.monotonic() > began + seconds:
            break
        if change is None:
            time.sleep(seconds)
            continue
        nb_responses += 1
        nb_made += api.patch("live/parameters", json=change).is_success
    last, elapsed = api.get("live").json(), time.monotonic() - began
    late = {edge: last["timing"]["late"][edge] - first["timing"]["late"][edge] for edge in ("5", "50")}
    ticks = last["timing"]["ticks"] - first["timing"]["ticks"]
    factor = (last["t"] - first["t"]) / elapsed
    latest = last["timing"]["late_ms_max"]
    return f"{nb_responses:9} {nb_made:6} {ticks:6} {late['5']:6} {late['50']:6} {latest:6.1f} ms {factor:6.3f}"


if __name__ == "__main__":
    main(tyro.cli(ParameterFlood))
