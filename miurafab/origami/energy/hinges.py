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

from miurafab.geometry.arrays import Floats, Ints, vector_product


class _Frames(NamedTuple):
    """Per hinge: the length ``l`` and direction ``t`` of the edge; per hinge and wing: ``s``, the
    height ``h``, the in-plane ``m`` and the normal ``n``.
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
    p = points[hinges]
    e = p[:, 1] - p[:, 0]
    length = np.sqrt(np.einsum("hk,hk->h", e, e))
    t = e / length[:, None]
    wings = p[:, 2:] - p[:, :1]
    along = np.einsum("hwk,hk->hw", wings, t)
    m = wings - along[..., None] * t[:, None]
    h = np.sqrt(np.einsum("hwk,hwk->hw", m, m))
    m = m / h[..., None]
    n = vector_product(t[:, None], m)
    n[:, 1] *= -1.0
    return _Frames(length, t, along / length[:, None], h, m, n)


def _angle(f: _Frames) -> Floats:
    # n_a x n_b is along t; its component there is n_b . (t x n_a) = -n_b . m_a
    sine = np.einsum("hk,hk->h", f.n[:, 1], f.m[:, 0])
    return np.asarray(np.arctan2(sine, np.einsum("hk,hk->h", f.n[:, 0], f.n[:, 1])))


def _gradient(f: _Frames) -> Floats:
    by_wing = f.n / f.h[..., None]
    by_e = -np.einsum("hw,hwk->hk", f.s, by_wing)
    gradient = np.empty((len(f.l), 4, 3))
    gradient[:, 1] = by_e
    gradient[:, 2:] = by_wing
    gradient[:, 0] = -by_e - by_wing[:, 0] - by_wing[:, 1]
    return gradient


def _hessian(f: _Frames) -> Floats:
    nm = f.n[..., :, None] * f.m[..., None, :]
    nm = nm + np.swapaxes(nm, -1, -2)
    tn = f.t[:, None, :, None] * f.n[..., None, :]
    per_height = 1.0 / f.h
    per_area = per_height / f.l[:, None]
    ww = -(per_height**2)[..., None, None] * nm
    we = -f.s[..., None, None] * ww - per_area[..., None, None] * tn
    ee = (f.s * per_area)[..., None, None] * (tn + np.swapaxes(tn, -1, -2)) - (
        (f.s * per_height) ** 2 + 0.5 / f.l[:, None] ** 2
    )[..., None, None] * nm
    hessian = np.zeros((len(f.l), 4, 3, 4, 3))
    hessian[:, 1, :, 1] = ee.sum(axis=1)
    for w in (0, 1):
        hessian[:, 2 + w, :, 2 + w] = ww[:, w]
        hessian[:, 2 + w, :, 1] = we[:, w]
        hessian[:, 1, :, 2 + w] = np.swapaxes(we[:, w], -1, -2)
    hessian[:, 0, :, 1:] = -hessian[:, 1:, :, 1:].sum(axis=1)
    hessian[:, 1:, :, 0] = -hessian[:, 1:, :, 1:].sum(axis=3)
    hessian[:, 0, :, 0] = -hessian[:, 0, :, 1:].sum(axis=2)
    return hessian
