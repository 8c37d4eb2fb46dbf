"""Pressure regulators, on a server of its own."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Iterator

import pytest
import server as servers

import taclink
import taclink.aio


@pytest.fixture(scope="module")
def inflatable(tmp_path_factory: pytest.TempPathFactory) -> Iterator[servers.Server]:
    """Of the links `skin`, which a simulated regulator inflates, and `bare`, which has none."""
    config = servers.HEAD + servers.links(
        servers.link("skin", "rest", ", pace: clock, pose: {position_mm: [0, 0, 0]}, pressure: {source: regulator}"),
        servers.link("bare", "rest", ", pose: {position_mm: [0, 0, 240]}"),
    )
    running = servers.measuring(tmp_path_factory.mktemp("inflatable"), config, "skin")
    yield running
    running.stop()


def test_a_setpoint_is_reached_and_vented(inflatable: servers.Server) -> None:
    with taclink.Client(inflatable.address, timeout=servers.PATIENCE_S) as client:
        before = client.regulator("skin")
        assert (before.state, before.setpoint_pa, before.trip) == ("closed", None, None)
        assert (before.min_pa, before.max_pa, before.max_ramp_pa_per_s) == (0, 1500, 500)
        after = client.set_pressure("skin", 400, ramp_pa_per_s=400)
        assert (after.state, after.target_pa, after.ramp_pa_per_s) == ("ramping", 400, 400)
        servers.until(lambda: client.regulator("skin").state == "holding", "the setpoint is reached")
        servers.until(lambda: abs((client.regulator("skin").measured_pa or 0) - 400) < 60, "the pressure is reached")
        frame = next(client.frames("skin"))
        assert frame.pressure is not None and frame.pressure.origin == "regulator"
        arm = client.arm()
        assert arm.links[0].regulator is not None and arm.links[0].regulator.target_pa == 400
        assert arm.links[1].regulator is None
        assert client.vent("skin").state == "closed"
        servers.until(lambda: abs(client.regulator("skin").measured_pa or 0) < 60, "the skin is vented")


def test_bad_orders_are_refused(inflatable: servers.Server) -> None:
    with taclink.Client(inflatable.address, timeout=servers.PATIENCE_S) as client:
        with pytest.raises(taclink.InvalidArgument, match="not within 0 and 1.5 kPa"):
            client.set_pressure("skin", 1600)
        with pytest.raises(taclink.InvalidArgument, match="at most 0.5 kPa/s"):
            client.set_pressure("skin", 100, ramp_pa_per_s=600)
        with pytest.raises(taclink.Refused, match="no pressure regulator"):
            client.set_pressure("bare", 100)
        with pytest.raises(taclink.NotFound):
            client.regulator("nobody")


def test_asyncio_has_the_same_calls(inflatable: servers.Server) -> None:
    async def run() -> None:
        async with taclink.aio.Client(inflatable.address, timeout=servers.PATIENCE_S) as client:
            assert (await client.set_pressure("skin", 0)).target_pa == 0
            assert (await client.vent("skin", reset_trip=True)).state == "closed"
            assert (await client.regulator("skin")).trip is None

    asyncio.run(run())
