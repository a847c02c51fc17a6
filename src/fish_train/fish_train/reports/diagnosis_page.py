"""The page of a diagnosis: verdict first, then where, evidence, rivals, before and after, what to try next."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go

from fish_sim.model import DT
from fish_sim.pool import LENGTH, WIDTH
from fish_train.diagnose.diagnosis import Diagnosis
from fish_train.diagnose.locate import DOFS
from fish_train.diagnose.own_force import ACTIVE
from fish_train.diagnose.search import Ranked, Round
from fish_train.reports.before_after import before_after
from fish_train.reports.page import Figure, Table, Text, styled, write_page

COLOURS = {"surge": "#5b6bd6", "sway": "#1fa774", "yaw": "#e07b39"}
SHOWN = 4000  # points of a scatter
Content = dict[str, Any]


def sentence(content: Content) -> str:
    """The verdict in one sentence, and in a second one whether the tail needed more links."""
    links = content["fit"]["tail_links"]
    if links["given"] == links["used"]:
        return _verdict(content)
    return f"{_verdict(content)} The tail is modelled with {links['used']} links instead of {links['given']}."


def _verdict(content: Content) -> str:
    found = content["effects"]
    if found:
        parts = [
            f"{e['name']} ({_parameters(e)}; probability {e['evidence']['probability']:.2f})" for e in found
        ]
        return f"{content['verdict']}: the model lacks {' and '.join(parts)}."
    if content["verdict"] == "unexplained":
        nearest = ", ".join(content["unexplained"]["nearest"])
        aside = f" Without explaining the most of it, {nearest} would help." if nearest else ""
        return f"unexplained: {content['unexplained']['description']}.{aside}"
    return "no_mismatch: with refitted parameters the model explains these recordings; nothing is missing."


def _parameters(effect: Content) -> str:
    rows = effect["parameters"].items()
    return ", ".join(f"{k} {p['value']:.4g} ± {p['std']:.2g} {p['unit']}" for k, p in rows)


def write_diagnosis_page(path: Path, name: str, content: Content, d: Diagnosis) -> None:
    """Write report.html."""
    blocks: list[Text | Table | Figure] = [
        _fit_table(content),
        before_after(d),
        Figure(
            "Missing force over the pool", _map(d), "darker: more force missing in the refitted nominal model"
        ),
        Figure(
            "Missing force over time",
            _time(d),
            "first training trial; grey: what remains with the effects found",
        ),
        Figure("Missing force against covariates", _covariates(d)),
        *(_when(entry) for entry in content["effects"] if entry["name"] in d.pushes),
        *_evidence(d),
        _whiteness(content),
        Text("Next experiment", content["next_experiment"]["why"]),
        Figure("Its program", _program(content)),
        Text("Out of reach", _unreachable(d)),
        Text("What remains", content["unexplained"]["description"]),
    ]
    write_page(path, f"Diagnosis of {name}", sentence(content), blocks)


def _fit_table(content: Content) -> Table:
    fit, rows = content["fit"], []
    for label in ("nominal", "refitted", "with_effects"):
        entry = fit[label]
        cells = [_errors(v) for v in entry["rms"].values()]
        rows.append([label.replace("_", " "), *cells, f"{entry['log_density_per_sample']:.3f}"])
    if fit["model_yaml"]:
        cells = [_errors(v) for v in fit["model_yaml"]["rms"].values()]
        rows.append(["model.yaml: refitted to predict over seconds", *cells, ""])
    header = ["model", *(f"{h}: m / rad / m/s" for h in fit["nominal"]["rms"]), "log density per sample"]
    low, high = fit["improvement_ci95"]
    held = ", ".join(fit["held_out_trials"]) or "none"
    gain = f"{low:.3f} to {high:.3f} nats per sample"
    note = f"Held out: {held}. Gain of the effects over the refitted model: 95 % interval {gain}."
    return Table("Prediction errors on held-out trials, before and after", header, rows, note)


def _errors(rms: Mapping[str, float]) -> str:
    return f"{rms['position_m']:.3f} / {rms['heading_rad']:.3f} / {rms['speed_m_s']:.3f}"


EVIDENCE_HEADER = ("name", "quick gain, nats", "refitted gain, nats", "parameters")
EVIDENCE_NOTE = (
    "Every candidate is fitted together with all nominal parameters and the noise; "
    "gains are over the refitted model, so what its parameters absorb does not count."
)


def _evidence(d: Diagnosis) -> list[Table]:
    tables = []
    for number, found in enumerate(d.rounds, 1):
        base = " + ".join(found.base.hypothesis.names) or "the nominal model"
        rows = [_evidence_row(found, ranked) for ranked in found.ranking]
        title = f"Evidence, round {number}: what {base} lacks"
        tables.append(Table(title, EVIDENCE_HEADER, rows, EVIDENCE_NOTE))
    return tables


def _evidence_row(found: Round, ranked: Ranked) -> list[str]:
    fit = found.refitted.get(ranked.name)
    if fit is None:
        return [ranked.name, f"{ranked.gain:.0f}", "", ""]
    own = {k: v for k, v in fit.values.items() if k.startswith(ranked.name + ".")}
    values = ", ".join(f"{k.split('.')[1]} {v:.4g} ± {fit.standard_errors[k]:.2g}" for k, v in own.items())
    return [ranked.name, f"{ranked.gain:.0f}", f"{found.gain(ranked.name):.0f}", values]


def _map(d: Diagnosis) -> go.Figure:
    c, scale = d.force.covariates, np.array(d.final.noise.wrench)
    e = np.sqrt(np.sum((d.force.wrench / scale) ** 2, axis=2)).ravel()
    x, y = c["x"].ravel(), c["y"].ravel()
    keep = np.flatnonzero(np.isfinite(e))
    keep = keep[:: max(1, len(keep) // SHOWN)]
    marker = {
        "size": 4,
        "color": np.minimum(e[keep], np.nanquantile(e, 0.98)),
        "colorscale": "Viridis_r",
        "showscale": True,
    }
    figure = go.Figure(go.Scatter(x=x[keep], y=y[keep], mode="markers", marker=marker))
    figure.add_shape(type="rect", x0=-LENGTH / 2, x1=LENGTH / 2, y0=-WIDTH / 2, y1=WIDTH / 2)
    figure.update_yaxes(scaleanchor="x", title="y, m")
    figure.update_xaxes(title="x, m")
    return styled(figure, 420)


def _time(d: Diagnosis) -> go.Figure:
    figure = go.Figure()
    t = DT * np.arange(len(d.force.wrench))
    for i, dof in enumerate(DOFS):
        unit = "N m" if dof == "yaw" else "N"
        figure.add_scatter(x=t, y=d.force.wrench[:, 0, i], name=f"{dof}, {unit}", line={"color": COLOURS[dof]},
                           visible=True if i < 2 else "legendonly")  # fmt: skip
        figure.add_scatter(x=t, y=d.remaining.wrench[:, 0, i], name=f"{dof} remaining", line={"color": "#999"},
                           visible=True if i == 0 else "legendonly")  # fmt: skip
    figure.update_xaxes(title="t, s")
    return styled(figure)


def _covariates(d: Diagnosis) -> go.Figure:
    from plotly.subplots import make_subplots

    names = ("surge_speed", "rudder", "yaw_rate", "wall_distance")
    figure = make_subplots(rows=1, cols=len(names), subplot_titles=names)
    for column, name in enumerate(names, 1):
        v = d.force.covariates[name].ravel()
        for i, dof in enumerate(DOFS):
            w = d.force.wrench[..., i].ravel()
            good = np.isfinite(v) & np.isfinite(w)
            edges = np.quantile(v[good], np.linspace(0, 1, 16))
            index = np.clip(np.searchsorted(edges, v[good]) - 1, 0, 14)
            mean = np.bincount(index, w[good], 15) / np.maximum(np.bincount(index, minlength=15), 1)
            figure.add_scatter(
                x=0.5 * (edges[1:] + edges[:-1]), y=mean / d.final.noise.wrench[i], name=dof, legendgroup=dof,
                line={"color": COLOURS[dof]}, showlegend=column == 1, row=1, col=column,
            )  # fmt: skip
    figure.update_yaxes(title="mean missing wrench / water noise", col=1)
    return styled(figure, 360, titled=True)


def _when(effect: Content) -> Figure:
    """The intervals in which an effect acts, a row per trial."""
    figure, times = go.Figure(), sorted(effect["where"]["time"], key=lambda row: row["trial"])
    figure.add_bar(
        y=[row["trial"] for row in times], base=[row["from"] for row in times],
        x=[row["to"] - row["from"] for row in times], orientation="h", marker={"color": COLOURS["surge"]},
        hovertext=[f"{row['share']:.0%} of its push" for row in times],
    )  # fmt: skip
    figure.update_xaxes(title="t, s")
    tells = effect["where"]["covariates"][0]
    low, high = tells["range"]
    note = (
        f"intervals in which its own force in the final model is above {ACTIVE:.0%} of what it is at its strongest; "
        f"{tells['name']} from {low:.3g} to {high:.3g} tells them best (F1 {tells['f1']:.2f})"
    )
    return Figure(
        f"When {effect['name']} acts", styled(figure, 120 + 26 * len({r["trial"] for r in times})), note
    )


def _program(content: Content) -> go.Figure:
    rows = content["next_experiment"]["program"]
    figure = go.Figure()
    t = [r["t"] for r in rows] + [rows[-1]["t"] + 8.0]
    for key in ("amplitude", "frequency", "rudder"):
        values = [r[key] for r in rows]
        figure.add_scatter(x=t, y=[*values, values[-1]], name=key, line={"shape": "hv"})
    figure.update_xaxes(title="t, s")
    return styled(figure)


def _whiteness(content: Content) -> Table:
    p = content["fit"]["residual_whiteness_p"]
    rows = [
        [name, f"{p['before'][name]:.3g}", f"{p['after'].get(name, float('nan')):.3g}"]
        for name in p["before"]
    ]
    note = "Ljung-Box over 0.2 s, worst trial, Bonferroni. Small: something is left in the residuals."
    return Table("Are the residuals white?", ["row", "before", "after"], rows, note)


def _unreachable(d: Diagnosis) -> str:
    return (
        "; ".join(f"{name}: {why}" for name, why in d.unreachable.items())
        or "All candidates could be judged."
    )
