"""The fold angle of a hinge with its gradient and Hessian, in closed form.

A hinge is the edge u -> v with a triangle (u, v, a) on its left and (v, u, b) on its right. With

    e = v - u, l = |e|, t = e / l, and for each wing w in (a, b), W = w - u:
    s_w = W.t / l        the foot of w along the edge, 0 at u and 1 at v
    h_w = |W - l s_w t|  its height, m_w = (W - l s_w t) / h_w, n_w the unit normal: n_a = t x m_a,
                         n_b = m_b x t, so that n_a = n_b where the hinge is flat

the fold angle is rho = -atan2((n_a x n_b).t, n_a.n_b), valley positive: lifting a wing along its
normal by d turns it by d / h_w. Hence, with G_w = n_w / h_w,

    d rho / d w = G_w,   d rho / d v = -sum s_w G_w,   d rho / d u = -sum (1 - s_w) G_w.

Differentiating once more (d n_w and d m_w by moving w or e, u held), with S_w = n_w m_w' + m_w n_w'
and Q_w = n_w t' + t n_w',

    d2 rho / dw dw = -S_w / h_w^2
    d2 rho / dw de =  s_w S_w / h_w^2 - t n_w' / (l h_w)
    d2 rho / de de =  sum  s_w Q_w / (l h_w) - (s_w^2 / h_w^2 + 1 / (2 l^2)) S_w

and d2 rho / da db = 0; the rows of u follow from d/du = -(d/de + d/da + d/db). The last line holds
only the symmetric part of n_w m_w', since the antisymmetric parts of the two wings cancel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from miurafab.geometry.arrays import Floats, Ints


class _Frames(NamedTuple):
    """The length ``l`` (H,) and direction ``t`` (3, H) of the edges; of both wings the foot ``s``
    and height ``h`` (2, H), and the in-plane ``m`` and the normal ``n`` (3, 2, H).

    Hinges come last, so that they lie side by side in memory: that takes half of the time.
    """

    l: Floats  # noqa: E741  (the letter of the algebra above)
    t: Floats
    s: Floats
    h: Floats
    m: Floats
    n: Floats


def hinge_angles(points: Floats, hinges: Ints) -> Floats:
    """(H,) signed fold angles in (-pi, pi], valley positive, radians.

    ``points`` (V, 3); ``hinges`` (H, 4) are the vertices u, v, a, b.
    """
    return _angle(_frames(points, hinges))


def hinge_gradients(points: Floats, hinges: Ints) -> tuple[Floats, Floats]:
    """Angles (H,) and their gradients (H, 4, 3) with respect to u, v, a, b, per unit of length."""
    frames = _frames(points, hinges)
    return _angle(frames), _gradient(frames)


def hinge_derivatives(points: Floats, hinges: Ints) -> tuple[Floats, Floats, Floats]:
    """Angles (H,), gradients (H, 4, 3) and Hessians (H, 4, 3, 4, 3) over u, v, a, b."""
    frames = _frames(points, hinges)
    return _angle(frames), _gradient(frames), _hessian(frames)


def _frames(points: Floats, hinges: Ints) -> _Frames:
    coordinates = np.ascontiguousarray(points.T)
    u, v, a, b = (coordinates.take(ends, axis=1) for ends in hinges.T)
    e = v - u
    length = np.sqrt(_dot(e, e))
    t = e / length
    m = np.stack([a - u, b - u], axis=1)
    along = _dot(m, t[:, None])
    m -= along * t[:, None]
    h = np.sqrt(_dot(m, m))
    m /= h
    n = np.empty_like(m)
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.multiply(t[i], m[j], out=n[k])
        n[k] -= t[j] * m[i]
    n[:, 1] *= -1.0
    return _Frames(length, t, along / length, h, m, n)


def _dot(a: Floats, b: Floats) -> Floats:
    """The scalar product over the first axis."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _angle(f: _Frames) -> Floats:
    # n_a x n_b is along t; its component there is n_b . (t x n_a) = -n_b . m_a
    return np.asarray(np.arctan2(_dot(f.n[:, 1], f.m[:, 0]), _dot(f.n[:, 0], f.n[:, 1])))


def _gradient(f: _Frames) -> Floats:
    gradient = np.empty((4, 3, len(f.l)))
    by_wing = f.n / f.h
    gradient[2:] = by_wing.swapaxes(0, 1)
    gradient[1] = -(f.s * by_wing).sum(axis=1)
    gradient[0] = -gradient[1] - gradient[2] - gradient[3]
    return np.ascontiguousarray(gradient.transpose(2, 0, 1))


def _hessian(f: _Frames) -> Floats:
    nm = f.n[:, None] * f.m
    nm += nm.swapaxes(0, 1).copy()
    tn = f.t[:, None, None] * f.n
    per_height = 1.0 / f.h
    per_area = per_height / f.l
    ww = -(per_height**2) * nm
    we = -f.s * ww - per_area * tn
    ee = (f.s * per_area) * (tn + tn.swapaxes(0, 1))
    ee -= ((f.s * per_height) ** 2 + 0.5 / f.l**2) * nm
    hessian = np.zeros((4, 3, 4, 3, len(f.l)))
    hessian[1, :, 1] = ee[:, :, 0] + ee[:, :, 1]
    for w in (0, 1):
        hessian[2 + w, :, 2 + w] = ww[:, :, w]
        hessian[2 + w, :, 1] = we[:, :, w]
        hessian[1, :, 2 + w] = we[:, :, w].swapaxes(0, 1)
    hessian[0, :, 1:] = -(hessian[1, :, 1:] + hessian[2, :, 1:] + hessian[3, :, 1:])
    hessian[1:, :, 0] = hessian[0, :, 1:].transpose(1, 2, 0, 3)
    hessian[0, :, 0] = -(hessian[0, :, 1] + hessian[0, :, 2] + hessian[0, :, 3])
    return np.ascontiguousarray(hessian.transpose(4, 0, 1, 2, 3))
