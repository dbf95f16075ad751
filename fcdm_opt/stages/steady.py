"""First contact along a steady motion: safe steps to second order, compiled.

A ray of one translation, rotation or screw turns body 1 steadily about a fixed line, so that every point's velocity
is known and its acceleration is as large everywhere: the turning rate squared times its distance from the line. That
bounds how long two parts stay apart along the direction in which they are, how long a point of one that is inside the
other stays there, and how long two points stay nearer than the clearance; near a contact such a step ends short of it
by the square of what was left.

Positions are about the moved seed at rest. A way is (direction of the line, a point on it, turn, shift), the latter
two per unit of amount. Solids are packed as `turns` packs them: points, (normal, level) of each face, edges as `cells`
takes them, and the first row of each part in these; obstacles are about s_2, each with the least gap it needs.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt.compiling import kernel, light, step
from fcdm_opt.curve.kernels import E1E2, V1F2, _at, _cross, _dot, _entry, _length, _minus, _times, _turned, _turned_back
from fcdm_opt.proof.cells import FIRST, KIND, SECOND, SIGN, _plus, best_site, inside, set_nearest

HALVINGS = 40  # of the time for which two points stay near
EAGER = 60  # steps at first that may be finest: near a contact they shrink fast, and prove more
TURNS, FALSI = 200, 60  # trials for a root, and of them those by regula falsi
SITE = 16
FAR = 1e300  # the excess of no pair at all: a finite one, as it is multiplied


@kernel
def _pose(motion, amount, R, m):
    """Set the rotation, row by row, and the displacement of the seed."""
    u, c, angle = motion[0], motion[1], motion[2, 0] * amount
    # 2 sin^2 loses nothing at small angles
    s, v = np.sin(angle), 2.0 * np.sin(0.5 * angle) ** 2
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        R[3 * i + i] = 1.0 - v * (1.0 - u[i] * u[i])
        R[3 * i + j] = v * u[i] * u[j] - s * u[k]
        R[3 * i + k] = v * u[i] * u[k] + s * u[j]
    for i in range(3):
        m[i] = c[i] + motion[2, 1] * amount * u[i]
        for j in range(3):
            m[i] -= R[3 * i + j] * c[j]


@step
def _velocity(motion, x):
    """Return the velocity of a point of body 1 at x, and its distance from the line."""
    u = _at(motion, 0)
    across = _cross(u, _minus(x, _at(motion, 1)))
    return _plus(_times(motion[2, 0], across), _times(motion[2, 1], u)), _length(across)


@kernel
def _time(room, rate, bend):
    """Return the time t > 0 at which rate t + bend t t / 2 reaches the room."""
    if room <= 0.0:
        return 0.0
    if bend <= 0.0:
        return room / rate if rate > 0.0 else np.inf
    return 2.0 * room / (rate + np.sqrt(rate * rate + 2.0 * bend * room))


@kernel
def _apart(motion, R, m, d, n, need, one, two):
    """Return how long a direction keeps two polyhedra `need` apart."""
    least, time = np.inf, np.inf
    for v in range(len(two)):
        least = min(least, _dot(n, _at(two, v)))
    leaning = _dot(n, _at(motion, 0))
    bend = motion[2, 0] ** 2 * np.sqrt(max(1.0 - leaning * leaning, 0.0))
    level = least + _dot(n, d) + _dot(n, m) - need
    for v in range(len(one)):
        x = _plus(_entry(m, 0), _turned(R, 0, _at(one, v)))
        rate, radius = _velocity(motion, x)
        time = min(time, _time(level - _dot(n, x), _dot(n, rate), bend * radius))
    return time


@kernel
def _held(motion, R, m, d, body, point, normals, levels, known):
    """Return how long a point of a body, in its own axes, stays inside the other polyhedron; `known`: in vain."""
    shift = _plus(m, d)
    if body == 0:
        x = _plus(_turned(R, 0, point), m)
        p, (rate, radius) = _minus(x, shift), _velocity(motion, x)  # in the axes of the other body
    else:
        rate, radius = _velocity(motion, _plus(shift, point))
        p = _turned_back(R, 0, _plus(point, d))
        rate = _times(-1.0, _turned_back(R, 0, rate))  # body 1's axes turn away under it
    bend, time = motion[2, 0] ** 2 * radius, np.inf
    for i in range(len(normals)):
        n = _at(normals, i)
        time = min(time, _time(levels[i] - _dot(n, p), _dot(n, rate), bend))
        if time <= known:
            return known
    return time


@kernel
def _overlapping(motion, R, m, d, depth, one, normals1, levels1, edges1, two, normals2, levels2, edges2):
    """Return how long two polyhedra overlap at least.

    By their depth and the speed of the fastest vertex; by a vertex of one inside the other, or a point of an edge.
    """
    fastest = 0.0
    for v in range(len(one)):
        fastest = max(fastest, _length(_velocity(motion, _plus(_entry(m, 0), _turned(R, 0, _at(one, v))))[0]))
    best = depth / fastest if fastest > 0.0 else np.inf
    p, u = np.empty(3), np.empty(3)
    for body in range(2):
        points, edges = (one, edges1) if body == 0 else (two, edges2)
        normals, levels = (normals2, levels2) if body == 0 else (normals1, levels1)
        for v in range(len(points)):
            best = _held(motion, R, m, d, body, _at(points, v), normals, levels, best)
        for e in range(len(edges)):
            ends = points[edges[e, 0]], points[edges[e, 1]]
            low, high = inside(R, d, body, ends, normals, levels, 0.0, p, u)
            if high > low:
                start, end = _entry(ends[0], 0), _entry(ends[1], 0)
                point = _plus(start, _times(0.5 * (low + high), _minus(end, start)))
                best = _held(motion, R, m, d, body, point, normals, levels, best)
    return best


@kernel
def _near(motion, R, m, d, x, y, need):
    """Return how long a point of body 1, in its axes, and one of the other about s_2 stay nearer than `need`."""
    turned = _turned(R, 0, x)
    rate, radius = _velocity(motion, _plus(turned, m))
    between, bend = _minus(_minus(turned, d), y), motion[2, 0] ** 2 * radius
    low, high, doubling = 0.0, need, True
    for _ in range(HALVINGS):
        t = high if doubling else 0.5 * (low + high)
        if _length(_plus(between, _times(t, rate))) + 0.5 * bend * t * t < need:
            low, high = t, (2.0 * t if doubling else high)
        else:
            high, doubling = t, False
    return low


@kernel
def _looked(motion, amount, ones, twos, offset, needs, pairs, partner, touch, timed, enough, until, found):
    """Set what holds at a pose of the part pairs: excess over the needed gap of partner's parts and others, and times.

    Pairs that are known to keep their gap until a later amount than this, by more than `enough`, are passed over;
    `until` is set anew of those that keep it here. found: partner's least excess, the others', how long one of
    partner's parts is too near, how long one of the others is, a pair too near for `enough`, -1 without, and how many
    pairs of edges were looked at, added up. Where there are no others nothing more is asked then, that of before first.
    With `touch` the partner's state is that of all pairs; without, the others count with it.
    """
    R, m, d = np.empty(9), np.empty(3), np.empty(3)
    _pose(motion, amount, R, m)
    for j in range(3):
        d[j] = offset[j] - m[j]
    points1, faces1, edges1, places1 = ones
    points2, faces2, edges2, places2 = twos
    site, x, y = np.zeros(SITE), np.empty(3), np.empty(3)
    excess, others, short, others_short = FAR, FAR, 0.0, 0.0
    before, single = int(found[4]), partner == len(places2) - 1 or not touch
    found[4] = -1.0
    for turn in range(-1 if timed and single and before >= 0 else 0, len(pairs)):
        code = before if turn < 0 else turn
        if until[code] > amount + enough:
            continue
        i, c = pairs[code, 0], pairs[code, 1]
        need = needs[c]
        a, b, a2, b2 = places1[i], places1[i + 1], places2[c], places2[c + 1]
        # copies, as those called take contiguous arrays: one version of each for all
        one, normals1, levels1 = points1[a[0] : b[0]], faces1[a[1] : b[1], :3].copy(), faces1[a[1] : b[1], 3].copy()
        two, normals2 = points2[a2[0] : b2[0]], faces2[a2[1] : b2[1], :3].copy()
        levels2 = faces2[a2[1] : b2[1], 3].copy()
        own1, own2 = edges1[a[2] : b[2]], edges2[a2[2] : b2[2]]
        first, second = (one, normals1, levels1, own1), (two, normals2, levels2, own2)
        gap = best_site(R, d, first, second, True, site)
        found[5] += len(own1) * len(own2)
        miss = gap - need
        if need > 0.0 and 0.0 < gap < need:  # facets understate the distance of corners and edges
            gap = set_nearest(R, d, one, two, x, y)
            miss = gap - need
        ours = c < partner or not touch
        if ours:
            excess = min(excess, miss)
        else:
            others = min(others, miss)
        if not timed:
            continue
        if miss < 0.0:
            if gap > 0.0:
                time = _near(motion, R, m, d, x, y, need)
            else:
                time = _overlapping(motion, R, m, d, -gap, one, normals1, levels1, own1, two, normals2, levels2, own2)
                if gap > -need:  # coming apart, they stay near
                    set_nearest(R, d, one, two, x, y)
                    time = max(time, _near(motion, R, m, d, x, y, need))
            if ours:
                short = max(short, time)
            else:
                others_short = max(others_short, time)
            if single and time >= enough:
                found[4] = code
                break
        else:
            n = _entry(site, FIRST)
            if site[KIND] != V1F2:
                n = _turned(R, 0, n)
            if site[KIND] == E1E2:
                n = _times(site[SIGN], _cross(n, _entry(site, SECOND)))
                n = _times(1.0 / _length(n), n)
            until[code] = amount + _apart(motion, R, m, d, n, need, one, two)
    found[0], found[1], found[2], found[3] = excess, others, short, others_short


@step
def _soonest(pairs, partner, until):
    """Return the amount until which all of partner's parts are known to keep their gap."""
    least = np.inf
    for code in range(len(pairs)):
        if pairs[code, 1] < partner:
            least = min(least, until[code])
    return least


@light
@kernel
def first(
    motion,
    ones,
    twos,
    offset,
    needs,
    pairs,
    partner,
    touch,
    limit,
    floor,
    finest,
    most,
    fine,
    slack,
    work,
    until,
    now,
    state,
):
    """Go on to the first motion that does, see `rays.FirstContact`; return whether that is done.

    With `touch` a change of side at which nothing else is too near; without, where all that is needed is reached.
    Steps are `floor` at least, the first ones `finest`. One call looks at about `work` pairs of edges; the next takes
    up where it left. `until`: up to which amount each pair is known to keep its gap, -inf at first; `now`: see
    `_looked`, -1 at first. state: amount so far, up to which nothing was found, whether that is proved, side of the
    start, 0 at first, and steps taken; when done, the first two are the result.
    """  # fmt: skip
    here, proved, sure, side = state[0], state[1], state[2] > 0.0, state[3]
    ahead, known = np.full(6, -1.0), until.copy()
    now[5] = 0.0
    if side == 0.0:
        _looked(motion, here, ones, twos, offset, needs, pairs, partner, touch, True, floor, until, now)
        side = -1.0 if now[0] < 0.0 else 1.0
    for turn in range(int(state[4]), most):
        if now[5] > work:
            state[0], state[1], state[2], state[3], state[4] = here, proved, (1.0 if sure else 0.0), side, turn
            return False
        if here >= limit:
            state[0], state[1] = np.inf, (limit if sure else proved)
            return True
        if not touch and now[0] >= 0.0:
            state[0], state[1] = here, (here if sure else proved)
            return True
        end = here + now[2] if now[0] < 0.0 else _soonest(pairs, partner, until)
        forbidden = touch and now[1] < 0.0 and here + now[3] > end
        if forbidden:
            end = here + now[3]
        proved = here if sure else proved
        least = floor if turn >= EAGER else finest
        sure = sure and (end >= here + least or here + least >= limit)
        there, ahead[4], ahead[5] = min(max(end, here + least), limit), now[4], now[5]
        known[:] = until  # from there back it is known no better
        _looked(motion, there, ones, twos, offset, needs, pairs, partner, touch, True, floor, until, ahead)
        if forbidden and end >= here + least:  # all the way: contacts there do not count
            side = -1.0 if ahead[0] < 0.0 else 1.0
        elif ahead[0] * side <= 0.0 and ahead[0] * now[0] <= 0.0:
            low, high, below, above = here, there, now[0], ahead[0]
            kept = 0  # of which end the last trial was
            for trial in range(TURNS):  # regula falsi (Illinois), then halves
                if above == 0.0 or high - low <= fine * high:
                    break
                middle = high - above * (high - low) / (above - below)
                if trial > FALSI or not low < middle < high:
                    middle = 0.5 * (low + high)
                    if not low < middle < high:
                        break
                _looked(motion, middle, ones, twos, offset, needs, pairs, partner, touch, False, floor, known, ahead)
                if ahead[0] * side > 0.0:
                    low, below, above, kept = middle, ahead[0], (0.5 * above if kept == 1 else above), 1
                else:
                    high, above, below, kept = middle, ahead[0], (0.5 * below if kept == 2 else below), 2
            there = high
            _looked(motion, there, ones, twos, offset, needs, pairs, partner, touch, False, floor, known, ahead)
            if ahead[1] >= -slack:
                state[0], state[1] = there, proved
                return True
            until[:] = known
            _looked(motion, there, ones, twos, offset, needs, pairs, partner, touch, True, floor, until, ahead)
            side = -side
        here = there
        now[:] = ahead
    state[0], state[1] = np.inf, proved
    return True
