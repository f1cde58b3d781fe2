"""``documentation/index.html``: what an FMU computes, how it is wired, its interface."""

from __future__ import annotations

import html
from collections.abc import Mapping

from ..machine import Machine
from .content import fmu_title
from .tables import interface_table
from .variables import variables_of

__all__ = ["index_page"]

_STYLE = """body{font-family:sans-serif;max-width:62em;margin:2em auto;padding:0 1em;line-height:1.4}
td,th{padding:.2em .6em;text-align:left;border-bottom:1px solid #ddd}
svg{max-width:100%}pre{background:#f4f4f4;padding:.8em}"""

_CITATION = """C.-H. Chou, M. Duan, C. E. Okwudire: <i>A linear hybrid model for enhanced servo error
pre-compensation of feed drives with unmodeled nonlinear dynamics</i>. CIRP Annals 70 (2021)."""

_COMPUTES = {
    "HybridPredictor": """
<p>The FMU sits between the interpolator and the drive and is the look-ahead buffer: what enters as
<code>x_d_ahead</code> leaves as <code>x_d</code> <code>Np</code> samples later. While the commands of a
window wait, it predicts the drive's position under them, with a physics-based linear model</p>
<p><i>G</i><sub>pb</sub>(s) = Σ<sub>i</sub> (α<sub>i</sub> + β<sub>i</sub> s) / (s² + 2 ζ<sub>i</sub>
ω<sub>i</sub> s + ω<sub>i</sub>²), &nbsp; ω<sub>i</sub> = 2π f<sub>n,i</sub>,</p>
<p>and with what it has learned of the residuals <i>e</i><sub>pb</sub> = x − x<sub>pb</sub> so far:</p>
<p>x<sub>h</sub>(k) = x<sub>pb</sub>(k) + wᵀφ(k), &nbsp; φ(k) = [1, x<sub>pb</sub>(k) … x<sub>pb</sub>(k−q),
e<sub>pb</sub>(k−1) … e<sub>pb</sub>(k−p)].</p>
<p>The weights minimise Σ (e<sub>pb</sub> − wᵀφ)² + λ‖w‖² over all samples measured before the window; they
are updated exactly, once a window, in bounded memory. Until <code>t_init</code> after the first fill,
x<sub>h</sub> = x<sub>pb</sub>.</p>
<p>Before the step that starts at t<sub>k</sub> = t<sub>start</sub> + k·T<sub>s</sub>, set
<code>x_d_ahead</code> = r(k) and <code>x_meas</code> = x(k); after it, the outputs are those of
t<sub>k+1</sub>, and x_d(k) = r(k − Np). No output depends on an input of the same instant. {steps} During
the first fill the drive gets the start value of <code>x_d_ahead</code>.</p>""",
    "SepCompensator": """
<p>The FMU sits between the interpolator and the drive and is the look-ahead buffer: what enters as
<code>x_d_ahead</code> is due as <code>x_d</code> <code>preview</code> samples later. What the drive gets then is
the modified command <code>x_dm</code>, made so that the drive's position follows <code>x_d</code>.</p>
<p>The drive is predicted as by the HybridPredictor, with a physics-based linear model</p>
<p><i>G</i><sub>pb</sub>(s) = Σ<sub>i</sub> (α<sub>i</sub> + β<sub>i</sub> s) / (s² + 2 ζ<sub>i</sub>
ω<sub>i</sub> s + ω<sub>i</sub>²), &nbsp; ω<sub>i</sub> = 2π f<sub>n,i</sub>,</p>
<p>and with what has been learned of its residuals: x<sub>h</sub>(k) = x<sub>pb</sub>(k) + wᵀφ(k). Over the preview
this is affine in the command, x<sub>h</sub> = <i>G</i><sub>h</sub> x<sub>dm</sub> + free response. The change
δ = x<sub>dm</sub> − x<sub>d</sub> is a sum of cubic B-splines, one knot every <code>spacing</code> samples, that
minimises Σ (x<sub>d</sub> − x<sub>h</sub>)² and <code>jerk_weight</code> times the sum of squares of δ's third
differences, within <code>v_max</code>, <code>a_max</code>, <code>j_max</code> and <code>change_max</code>; with
<code>no_reversal</code>, x<sub>dm</sub> never turns while x<sub>d</sub> moves. It is planned anew every
<code>Np</code> samples, from what was measured until then. With <code>v_friction</code> &gt; 0, φ has further
features of the reference alone, tanh of x<sub>d</sub>'s velocity over <code>v_friction</code>, from which the sign of
friction is learned.</p>
<p><code>sep_state</code> says which model planned the current window. Until <code>t_init</code> after the first fill,
and whenever the hybrid model is less accurate than the physics model or unstable, it is the physics model;
<code>compensate</code> limits the choice, and 0 leaves the command as it is.</p>
<p>Before the step that starts at t<sub>k</sub> = t<sub>start</sub> + k·T<sub>s</sub>, set
<code>x_d_ahead</code> = r(k) and <code>x_meas</code> = x(k); after it, the outputs are those of
t<sub>k+1</sub>, and x_d(k) = r(k − preview). No output depends on an input of the same instant. {steps} During
the first fill x_d is the start value of <code>x_d_ahead</code>, and nothing is learned.</p>""",
    "FeedDrive": """
<p>The simulated drive that the predictor is tried on. It starts at rest at the start value of
<code>x_d</code>, holds <code>x_d</code> over each communication step, and integrates in internal steps of at
most 0.1 ms. The encoder adds a normal random number to the position at each communication point; the same
<code>seed</code> gives the same numbers on every platform.</p>""",
    "ReferenceTrajectory": """
<p>Plays a commanded trajectory sample by sample, so that whole systems run in any tool without a script: the
staircase (six 10 mm moves, one at the start of each second, three up and three down), the spiral's X and Y
(five turns, 30 mm, within 80 mm/s, 8 m/s² and 1000 m/s³ along the path), or the samples given when the FMU
was built. After its last sample it stays there.</p>""",
}

_STEPS = """Any communication step is accepted: inputs
are read at the t<sub>k</sub> that lie in it, and outputs are always those of the last t<sub>k</sub> that was reached. A
closed loop needs steps of <code>T_s</code>, because <code>x_meas</code> is as old as the step's start otherwise."""

_PARTNERS = {"SepCompensator": ("SepCompensator", "x_dm")}
"""What sits between trajectory and drive, and its output to the drive; otherwise the predictor and its x_d."""

_WIRING = """<svg viewBox="0 0 760 190" xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" font-size="14">
<defs><marker id="a" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" orient="auto">
<path d="M0 0L10 5L0 10z"/></marker></defs>
<g fill="#eef3f8" stroke="#1f4e79" stroke-width="2"><rect x="10" y="40" width="170" height="70" rx="6"/>
<rect x="295" y="40" width="170" height="70" rx="6"/><rect x="580" y="40" width="170" height="70" rx="6"/></g>
<g text-anchor="middle"><text x="95" y="80">ReferenceTrajectory</text><text x="380" y="80">{partner}</text>
<text x="665" y="80">FeedDrive</text></g>
<g stroke="#222" stroke-width="1.5" fill="none" marker-end="url(#a)"><path d="M180 75H295"/><path d="M465 75H580"/>
<path d="M665 110V160H380V110"/></g>
<g text-anchor="middle"><text x="237" y="66">r → x_d_ahead</text><text x="522" y="66">{command} → x_d</text>
<text x="522" y="152">x_meas → x_meas</text></g></svg>"""

_EXAMPLE = """t_k:   {partner}.x_d_ahead = ReferenceTrajectory.r
       {partner}.x_meas = FeedDrive.x_meas
       FeedDrive.x_d = {partner}.{command}
       then all three step by T_s"""


_REFERENCE = """<h2>Check it</h2>
<p><a href="reference/{name}_ref.csv">reference/{name}_ref.csv</a> holds the outputs that a run with all start values
must give{inputs}; <code>{name}_ref.opt</code> its times. They come from hybridsep's library, which computes the same
independently; the FMU agrees within 10<sup>−{digits}</sup> m.</p>"""

_AGREEMENT_DIGITS = {"SepCompensator": 9}
"""Else 11; a plan under limits comes from an iteration, which passes differences of rounding on."""


_SOURCES = {
    "ReferenceTrajectory": (
        "C.-H. Chou, M. Duan, C. E. Okwudire: A linear hybrid model for enhanced servo error pre-compensation of feed "
        "drives with unmodeled nonlinear dynamics; the limits of eq. (14), the moves of its figures",
        "hybridsep computes the samples, one every T_s; the figures do not print the spiral's size",
    )
}
"""Of what does not come from the machine."""


def index_page(
    machine: Machine, description: Mapping[str, object], needs: str, *, reference: bool = False, limits: str = ""
) -> bytes:
    """Return the page a tool shows for an FMU.

    Parameters
    ----------
    machine : Machine
        Where its numbers come from.
    description : mapping
        ``model``, ``name``, ``parameters`` and ``modes``.
    needs : str
        One sentence: what the FMU needs to run.
    reference : bool
        Whether the archive has a reference result.
    limits : str
        A section on what the FMU's flavour cannot do, HTML.
    """
    model, name = str(description["model"]), str(description["name"])
    rows = "\n".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
        for row in interface_table(variables_of(description))
    )
    has_inputs = model != "ReferenceTrajectory"
    inputs = f', fed with <a href="reference/{name}_in.csv">reference/{name}_in.csv</a>' if has_inputs else ""
    digits = _AGREEMENT_DIGITS.get(model, 11)
    check = _REFERENCE.format(name=name, inputs=inputs, digits=digits) if reference else ""
    partner, command = _PARTNERS.get(model, ("HybridPredictor", "x_d"))
    sources = "\n".join(f"<li>{html.escape(source)}</li>" for source in _SOURCES.get(model, machine.sources))
    page = f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{name}</title>
<style>{_STYLE}</style></head><body>
<h1>{name}</h1>
<p>{html.escape(fmu_title(machine, model))}. {html.escape(needs)}</p>
<h2>What it computes</h2>
{_COMPUTES[model].replace("{steps}", _STEPS)}
<p>After {_CITATION}</p>
<h2>Wiring</h2>
{_WIRING.format(partner=partner, command=command)}
<pre>{_EXAMPLE.format(partner=partner, command=command)}</pre>
<p>All three exchange their values at each communication point and then step (Jacobi). Set the start values of
<code>{partner}.x_d_ahead</code> and <code>FeedDrive.x_d</code> to the trajectory's first position.</p>
<h2>Interface</h2>
<table><tr><th>name</th><th>causality</th><th>type, unit</th><th>start</th><th>meaning</th></tr>
{rows}
</table>
{check}
{limits}
<h2>Where the numbers come from</h2>
<ul>
{sources}
</ul>
</body></html>
"""
    return page.encode()
