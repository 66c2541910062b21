"""Where trials are played: processes of this machine, or the workers of a Dask cluster."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lira.hal.errors import ConfigError
from lira.tools.experiments.playing.fingerprint import fingerprint
from lira.tools.experiments.trial import Outcome, Trial, play

if TYPE_CHECKING:
    from distributed import Client

PATIENCE_S = 10.0  # to reach a scheduler


@dataclass(frozen=True, slots=True)
class Here:
    """So many processes of this machine."""

    workers: int

    def __call__(self, trials: Sequence[Trial]) -> Iterator[Outcome]:
        """Yield outcomes as they come."""
        from joblib import Parallel, delayed
        from joblib.externals.loky import get_reusable_executor

        running = Parallel(n_jobs=self.workers, return_as="generator_unordered")
        try:
            yield from running(delayed(play)(trial) for trial in trials)
        finally:
            if self.workers > 1:  # else they wait minutes for more, and this process for them
                get_reusable_executor().shutdown(kill_workers=True)


@dataclass(frozen=True, slots=True)
class Cluster:
    """The workers of a Dask scheduler, which has to run already."""

    address: str

    def __call__(self, trials: Sequence[Trial]) -> Iterator[Outcome]:
        """Yield outcomes as they come. Raises `ConfigError` for a cluster that is not there or would play otherwise."""
        from distributed import Client, as_completed

        try:
            client = Client(self.address, timeout=PATIENCE_S)
        except (OSError, ValueError) as error:
            raise ConfigError(
                f"no Dask scheduler answers at {self.address}: {error}", "Start one: dask scheduler"
            ) from error
        with client:
            self._check(client, trials)
            for future in as_completed(client.map(play, trials, pure=False)):
                yield future.result()

    def _check(self, client: "Client", trials: Sequence[Trial]) -> None:
        """A trial uses the whole process it runs in, and every worker has to have the same code and experts."""
        threads = client.nthreads()
        start = f"dask worker {self.address} --nworkers 2 --nthreads 1"
        if not threads:
            raise ConfigError(f"the cluster at {self.address} has no worker", f"Start some: {start}")
        if max(threads.values()) > 1:
            raise ConfigError("a worker of the cluster has more than one thread", f"Start it again: {start}")
        for world, pair in {(trial.world, trial.pair) for trial in trials}:
            ours = fingerprint(world, pair)
            for worker, theirs in client.run(fingerprint, world, pair).items():
                if theirs != ours:
                    raise ConfigError(
                        f"the worker {worker} has other code or other experts than this machine",
                        "Bring it to the same version.",
                    )
