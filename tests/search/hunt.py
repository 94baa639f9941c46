"""Hunt for an unsafe touchdown: generations of flights, kept in a file from which a later run goes on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from dataclasses import fields as fields_of
from pathlib import Path

import numpy as np

from tests.search.flight import REFUSED, TAKEN, Outcome
from tests.search.flights import Flier, FlyAll, flying
from tests.search.flown_file import Flown, FlownFile, InputError
from tests.search.niche_search import next_generation
from tests.search.scenario import Scenario
from tests.search.scored import Scored
from tests.search.surprise import surprises

GENERATION = 20


class Hunt:
    """Search of one program for unsafe touchdowns.

    Parameters
    ----------
    path
        File of flights, see `FlownFile`.
    flier
        Flies the scenarios; the file says in which detail.
    jobs
        Processes that fly; with more than one, `flier` must be picklable.
    confirm
        Says whether an unsafe touchdown is what is hunted; None takes each.

    Attributes
    ----------
    failures
        Scenarios with an unsafe touchdown of the companion's own, as far as they are what is hunted.
    """

    def __init__(
        self,
        path: Path,
        flier: Flier,
        seed: int,
        jobs: int = 1,
        confirm: Callable[[Scenario], bool] | None = None,
    ) -> None:
        self._flier, self._seed, self._jobs, self._confirm = flier, seed, jobs, confirm
        fields = ("scenario", "failure", *(field.name for field in fields_of(Outcome)))
        self._file = FlownFile(path, {"search": path.stem, "seed": seed} | flier.head, fields)
        try:
            scenarios = [Scenario.of(**one["scenario"]) for one in self.flown]
        except (TypeError, ValueError) as error:
            raise InputError(f"{path}: a flight has no scenario of this program: {error}") from None
        self.failures = [
            scenario for scenario, one in zip(scenarios, self.flown, strict=True) if one["failure"]
        ]

    @property
    def flown(self) -> list[Flown]:
        """All flights, in their order: scenario, margin, score, end, whether it is a failure."""
        return self._file.flown

    def run(self, budget: int, *, failures: int = 1) -> list[Scenario]:
        """Fly until as many failures are found or the budget is flown; return the failures."""
        if len(self.flown) < budget and len(self.failures) < failures:
            with flying(self._flier, self._jobs) as fly_all:
                self._fly_generations(fly_all, budget, failures)
        return self.failures

    def _fly_generations(self, fly_all: FlyAll, budget: int, failures: int) -> None:
        while len(self.flown) < budget and len(self.failures) < failures:
            generation, done = divmod(len(self.flown), GENERATION)
            rng = np.random.default_rng([self._seed, generation])
            scored = _scored(self.flown[: generation * GENERATION])
            scenarios = next_generation(rng, scored, GENERATION)[done:]
            for scenario, outcome in zip(scenarios, fly_all(scenarios), strict=True):
                self._note(scenario, outcome)
                if len(self.flown) >= budget or len(self.failures) >= failures:
                    break

    def _note(self, scenario: Scenario, outcome: Outcome) -> None:
        flown = {"scenario": dict(scenario.values)} | asdict(outcome)
        flown["failure"] = is_failure(flown) and (self._confirm is None or self._confirm(scenario))
        self._file.add(flown)
        if flown["failure"]:
            self.failures.append(scenario)


def _scored(flown: Sequence[Flown]) -> list[Scored]:
    """Return scores to learn from: not of what failed, was refused, or landed by the autopilot alone."""
    taught = [one for one in flown if one["end"] not in (TAKEN, REFUSED) and not is_failure(one)]
    scenarios = [Scenario.of(**one["scenario"]) for one in taught]
    responses = [one["response"] for one in taught]
    return [
        Scored(
            one["score"],
            one["margin"],
            min(one["response"].values(), default=1.0),
            each,
            f"{one['end']} {sorted(one['response'])}",
            scenario,
            one["missed"],
        )
        for one, scenario, each in zip(taught, scenarios, surprises(scenarios, responses), strict=True)
    ]


def is_failure(flown: Flown) -> bool:
    """Return whether a flight ended unsafely, and not by a failsafe of the autopilot."""
    return bool(flown["margin"] < 0.0 and flown["end"] != TAKEN)
