"""Every run of a campaign, specified."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from daemon.campaign.load import Campaign, repeat_seed
from daemon.parcel import fingerprint
from daemon.protocol import Submission
from daemon.spec import OracleText, RunSpec


def expand(campaign: Campaign, *, fresh: bool = False) -> Submission:
    """Return every run of the campaign, scenario by scenario, SUT by SUT, repeat by repeat.

    The campaign's id is its name and a digest of all there is to it, so that submitting the same
    campaign twice is submitting it once; ``fresh`` asks for a new id, to run everything again.
    Repeats beyond those every cell gets are in reserve, for cells that are not decided by then.
    """
    specs = tuple(_specs(campaign))
    scenes = {cell.scene.digest: cell.scene for cell in campaign.cells}
    submission = Submission(
        campaign="",
        name=campaign.name,
        about=campaign.about,
        source=campaign.source,
        runs=tuple(spec for spec in specs if spec.repeat < campaign.repeats),
        scenes=tuple(scenes.values()),
        declared=campaign.declared,
        reserve=tuple(spec for spec in specs if spec.repeat >= campaign.repeats),
        fresh=fresh,
    )
    identity = secrets.token_hex(4) if fresh else fingerprint(submission)[0][:8]
    return replace(submission, campaign=f"{campaign.name}-{identity}")


def _specs(campaign: Campaign) -> Iterator[RunSpec]:
    for cell in campaign.cells:
        digest = cell.scene.digest
        oracles = tuple(OracleText(o.name, o.text) for o in cell.oracles)
        for sut in cell.suts:
            for repeat, behaviours in enumerate(cell.behaviours):
                seed = repeat_seed(campaign.seed, repeat).generate_state(1, np.uint64)
                yield RunSpec(
                    campaign=campaign.name,
                    scenario=cell.name,
                    sut=sut,
                    repeat=repeat,
                    scene=digest,
                    robot=cell.robot,
                    mission=cell.mission,
                    behaviours=behaviours,
                    oracles=oracles,
                    map=cell.map,
                    seed=int(seed[0]),
                    limit=cell.limit,
                )
