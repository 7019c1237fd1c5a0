"""A task on a worker of a scheduler on this computer."""

import operator

from distributed import Client, LocalCluster


def exchange() -> None:
    """Two numbers there and their product back."""
    with (
        LocalCluster(n_workers=1, processes=False, dashboard_address=None) as workers,  # type: ignore[no-untyped-call]
        Client(workers) as client,  # type: ignore[no-untyped-call]
    ):
        assert client.submit(operator.mul, 6, 7).result(30) == 42
