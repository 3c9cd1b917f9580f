"""Campaign files: from layers by name to run specifications."""

from daemon.campaign._campaign import (
    Campaign,
    campaign_origin,
    campaign_text,
    expand,
    noise_seed,
    run_spec,
)
from daemon.campaign._composer import Composer
from daemon.campaign._file import CampaignFile
from daemon.campaign._layers import (
    FLOORPLAN,
    LAYER_KINDS,
    MISSION,
    ORACLES,
    ROBOT,
    SCENERY,
    SUT,
    VARIATION,
    CampaignCell,
    LayerKind,
    LayerLibrary,
    find_layer,
    layer_names,
    layer_places,
)
from daemon.campaign._loader import check_campaign, examine, load_campaign
from daemon.campaign._parameter_files import (
    ParameterValues,
    flatten_parameters,
    merge_parameters,
    parameter_tree,
)
from daemon.campaign._scenarios import LayerReference, ResolvedScenario, required, with_overrides
from daemon.campaign._search_file import read_budget, read_confirm, read_stop
from daemon.campaign._searches import LEAST_CONFIRMED
from daemon.campaign._suts import LoadedSut, RefusedSutError, SutFile

__all__ = [
    "FLOORPLAN",
    "LAYER_KINDS",
    "LEAST_CONFIRMED",
    "MISSION",
    "ORACLES",
    "ROBOT",
    "SCENERY",
    "SUT",
    "VARIATION",
    "Campaign",
    "CampaignCell",
    "CampaignFile",
    "Composer",
    "LayerKind",
    "LayerLibrary",
    "LayerReference",
    "LoadedSut",
    "ParameterValues",
    "RefusedSutError",
    "ResolvedScenario",
    "SutFile",
    "campaign_origin",
    "campaign_text",
    "check_campaign",
    "examine",
    "expand",
    "find_layer",
    "flatten_parameters",
    "layer_names",
    "layer_places",
    "load_campaign",
    "merge_parameters",
    "noise_seed",
    "parameter_tree",
    "read_budget",
    "read_confirm",
    "read_stop",
    "required",
    "run_spec",
    "with_overrides",
]
