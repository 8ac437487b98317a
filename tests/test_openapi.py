"""The API responds as its document says, to valid and to invalid requests."""

from typing import Any

import httpx
import pytest
import schemathesis
from conftest import PATIENCE
from hypothesis import HealthCheck, given, settings
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import positive_data_acceptance

pytestmark = pytest.mark.server("hrp2", RUNS_QUEUED="5")

ANSWERED = [
    positive_data_acceptance,  # of a scenario that is valid by its schema the walk may still be impossible
    not_a_server_error,  # 503 is an answer: the queue is full; an undocumented one is found, and nothing documents 500
]


@pytest.mark.parametrize(
    ("mode", "nb_examples"),
    [
        (GenerationMode.POSITIVE, 4),
        *(pytest.param(mode, 100, marks=pytest.mark.exhaustive) for mode in GenerationMode),
    ],
    ids=lambda value: getattr(value, "value", value),
)
def test_every_response_is_as_documented(server, mode, nb_examples):
    document = schemathesis.openapi.from_url(f"{server.url}openapi.json")
    problems = []
    for found in document.get_all_operations():
        operation = found.ok()
        try:
            try_out(operation, mode, nb_examples)
        except Unsatisfiable:  # it takes nothing that could be wrong
            assert mode is GenerationMode.NEGATIVE
        except BaseExceptionGroup as failures:
            problems += [f"{operation.label}: {failure}" for failure in failures.exceptions]
        except Exception as failure:
            problems.append(f"{operation.label}: {failure!r}")
    assert not problems, "\n".join(problems)


def test_every_refusal_has_the_one_shape(server):
    document = httpx.get(f"{server.url}openapi.json")
    assert "HTTPValidationError" not in document.text
    for path in document.json()["paths"].values():
        for operation in path.values():
            assert not {"500", "5XX", "default"} & set(operation.get("responses", {}))


def try_out(operation: Any, mode: GenerationMode, nb_examples: int) -> None:
    @settings(max_examples=nb_examples, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(case=operation.as_strategy(generation_mode=mode))
    def send(case: Any) -> None:
        case.call_and_validate(timeout=PATIENCE, excluded_checks=ANSWERED)

    send()
