"""What a cloud of particles says: the heaviest cluster, and the spread of all (amcl ``pf``)."""

from __future__ import annotations

import math

from daemon.navigation.kernels import Integers, kernel
from grammars.values import Floats


@kernel
def summarise(
    poses: Floats,
    directions: Floats,
    weights: Floats,
    count: int,
    of: Integers,
    labels: Integers,
    clusters: int,
    sums: Floats,
    result: Floats,
) -> bool:
    """Write estimate (3), mean of all (3) and covariance of all: xx, xy, yy, yaw (4).

    The estimate is the weighted mean of the cluster with the largest weight (of the first one
    when several have it), headings averaged on the circle; ``-2 ln R`` is the variance of
    headings with mean resultant length R. ``sums`` (clusters, 5) is scratch. Returns whether
    there is an estimate at all: not when no particle weighs anything.
    """
    sums[:clusters] = 0.0
    total = x_sum = y_sum = c_sum = s_sum = xx = xy = yy = 0.0
    for i in range(count):
        w, x, y = weights[i], poses[0, i], poses[1, i]
        wx, wy = w * x, w * y
        k = labels[of[i]]
        sums[k, 0] += w
        sums[k, 1] += wx
        sums[k, 2] += wy
        sums[k, 3] += w * directions[0, i]
        sums[k, 4] += w * directions[1, i]
        xx += wx * x
        xy += wx * y
        yy += wy * y
    best = 0
    for k in range(clusters):
        total += sums[k, 0]
        x_sum += sums[k, 1]
        y_sum += sums[k, 2]
        c_sum += sums[k, 3]
        s_sum += sums[k, 4]
        if sums[k, 0] > sums[best, 0]:
            best = k
    weight = sums[best, 0]
    if not weight > 0.0:
        return False
    result[0], result[1] = sums[best, 1] / weight, sums[best, 2] / weight
    result[2] = math.atan2(sums[best, 4], sums[best, 3])
    mx, my = x_sum / total, y_sum / total
    result[3], result[4], result[5] = mx, my, math.atan2(s_sum, c_sum)
    result[6] = xx / total - mx * mx
    result[7] = xy / total - mx * my
    result[8] = yy / total - my * my
    length = math.hypot(c_sum, s_sum)
    # Rounding may lengthen the resultant of equal headings beyond 1.
    result[9] = max(0.0, -2.0 * math.log(length)) if length > 0.0 else math.inf
    return True
