"""Both costmaps of a configuration, and who of their sources hears a laser."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, Final

from daemon.stacks.findings import ParameterFinding, ParameterLocation
from daemon.stacks.ros1.amcl import AmclParameters
from daemon.stacks.ros1.costmap.layers import LayeredCostmap, ObservationSource, ObstacleLayer
from daemon.stacks.ros1.costmap.reading import CostmapContext, CostmapReader
from daemon.stacks.ros1.parameters import ParameterTree
from daemon.stacks.ros1.topics import ONE_LASER, TopicParameters, Topics, resolve_topics

COSTMAPS: Final = ("global_costmap", "local_costmap")
_ONLY_LOCAL_SHOWN: Final = "only the local costmap is shown"


def read_costmaps(
    tree: ParameterTree, given: TopicParameters, localisation: AmclParameters
) -> tuple[dict[str, LayeredCostmap], Topics]:
    """Return both costmaps, and who listens where."""
    topics = resolve_topics(given, (), ())
    if not topics.heard(ONE_LASER).amcl and not topics.by_laser:
        message = f"amcl listens to {topics.amcl}, the scan comes on {topics.published}"
        hint = "amcl never corrects odometry: set topics/amcl or topics/remap"
        tree.report.problems.append(ParameterFinding(("topics",), message, hint))
    context = CostmapContext(
        above=tree.at("move_base"),
        frames={
            localisation.global_frame_id.strip("/"): "map",
            localisation.odom_frame_id.strip("/"): "odom",
        },
        resolve=lambda name: given.resolve("move_base", name),
        maps=given.resolved_maps(),
        may_carry_scan=topics.may_carry_scan,
    )
    costmaps = {name: _read_costmap(tree, name, context) for name in COSTMAPS}
    wide, near = (
        tuple(dict.fromkeys(source.topic for source in laser_sources(costmaps[name])))
        for name in COSTMAPS
    )
    topics = replace(topics, global_costmap=wide, local_costmap=near)
    for name, costmap in costmaps.items():
        tree.report.problems += _deaf_sources(name, costmap, topics, tree.at("move_base", name))
    return costmaps, topics


def _read_costmap(tree: ParameterTree, name: str, context: CostmapContext) -> LayeredCostmap:
    path = ("move_base", name)
    given = tree.at(*path)
    wide = name == "global_costmap"
    # MoveBase::executeCycle asks the controller's costmap alone whether it is current.
    costmap = CostmapReader(given, path, tree.report, replace(context, stops_robot=not wide)).read()
    if wide and "publish_frequency" in given:
        tree.report.without_effect.append(
            ParameterFinding((*path, "publish_frequency"), _ONLY_LOCAL_SHOWN)
        )
    if not wide and given and "global_frame" not in given:
        message = "global_frame is not given: ROS takes map, a local costmap usually has odom"
        hint = "write global_frame: odom, or map if that is meant"
        tree.report.problems.append(ParameterFinding(path, message, hint))
    return costmap


def laser_sources(costmap: LayeredCostmap) -> tuple[ObservationSource, ...]:
    """Return the sources of all layers of a costmap, the lowest layer first."""
    return tuple(
        source
        for layer in costmap.layers
        if isinstance(layer, ObstacleLayer)
        for source in layer.sources
    )


def _deaf_sources(
    name: str, costmap: LayeredCostmap, topics: Topics, given: Mapping[str, Any]
) -> Iterator[ParameterFinding]:
    """Yield what is to be said of sources on topics where no laser can be."""
    title = name.replace("_", " ")
    sources = laser_sources(costmap)
    deaf = [source for source in sources if not topics.may_carry_scan(source.topic)]
    hint = f"the {title} shows no obstacle that the map does not show"
    comes = topics.published
    if topics.by_laser:
        comes = ", ".join(topic for each in topics.by_laser.values() for topic in each)
    if not any(isinstance(layer, ObstacleLayer) for layer in costmap.layers):
        message = f"the {title} has no obstacle layer"
        yield ParameterFinding(("move_base", name, "plugins"), message, hint)
    elif not sources:
        message = f"the {title} has no source of type LaserScan"
        yield ParameterFinding(("move_base", name, "observation_sources"), message, hint)
    elif len(deaf) == len(sources):
        listens = ", ".join(dict.fromkeys(source.topic for source in deaf))
        message = f"the {title} listens to {listens}, the scan comes on {comes}"
        yield ParameterFinding(_place(name, costmap, deaf[0], given), message, hint)
    else:
        for source in deaf:
            message = f'the source "{source.name}" of the {title} listens to {source.topic}'
            hint = f"no laser is there: lasers come on {comes}"
            yield ParameterFinding(_place(name, costmap, source, given), message, hint)


def _place(
    name: str, costmap: LayeredCostmap, source: ObservationSource, given: Mapping[str, Any]
) -> ParameterLocation:
    """Return where the topic of a source stands: below its layer, or flat in the costmap's."""
    layers = (each for each in costmap.layers if isinstance(each, ObstacleLayer))
    layer = next(each.name for each in layers if source in each.sources)
    own = given.get(layer)
    inside = isinstance(own, Mapping) and source.name in own
    return ("move_base", name, *((layer,) if inside else ()), source.name, "topic")
