"""Small pictures as SVG, for designs and curves in notebooks."""
import html

import numpy as np

_WIDTH, _HEIGHT, _LEFT, _BOTTOM, _TOP = 640, 240, 60, 34, 26
_MEASURED, _PREDICTED = "#888888", "#0072b2"


def _frame(body, title, horizontal, vertical, low, high, last):
    plot = _HEIGHT - _BOTTOM
    text = "font-family='sans-serif' font-size='11' fill='#444'"
    return (f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {_WIDTH} {_HEIGHT}' role='img' "
            f"aria-label='{html.escape(title)}'><rect width='{_WIDTH}' height='{_HEIGHT}' "
            f"fill='white'/><text x='{_LEFT}' y='16' {text}>{html.escape(title)}</text>"
            f"<line x1='{_LEFT}' y1='{plot}' x2='{_WIDTH - 10}' y2='{plot}' stroke='#888'/>"
            f"<text x='{_LEFT - 4}' y='{_TOP + 8}' text-anchor='end' {text}>{high:.3g}</text>"
            f"<text x='{_LEFT - 4}' y='{plot}' text-anchor='end' {text}>{low:.3g}</text>"
            f"<text x='{_LEFT}' y='{plot + 14}' {text}>0</text>"
            f"<text x='{_WIDTH - 10}' y='{plot + 14}' text-anchor='end' {text}>{last}</text>"
            f"<text x='{(_LEFT + _WIDTH) / 2}' y='{plot + 26}' text-anchor='middle' {text}>"
            f"{html.escape(horizontal)}</text><text x='{_WIDTH - 10}' y='16' text-anchor='end' "
            f"{text}>{html.escape(vertical)}</text>{body}</svg>")


def stems(values, vertical, title):
    """A stem for each candidate that is not zero."""
    values = np.asarray(values, dtype=float)
    high = values.max() or 1.0
    plot = _HEIGHT - _BOTTOM
    scale = (_WIDTH - 10 - _LEFT) / max(len(values) - 1, 1)
    body = "".join(
        f"<line x1='{_LEFT + scale * i:.1f}' x2='{_LEFT + scale * i:.1f}' y1='{plot}' "
        f"y2='{plot - (plot - _TOP) * values[i] / high:.1f}' stroke='{_PREDICTED}' "
        f"stroke-width='2'/>" for i in np.flatnonzero(values)[:2000])
    return _frame(body, title, "candidate", vertical, 0.0, high, len(values) - 1)


def curves(curve):
    """What was measured and what is predicted, over time."""
    time = np.asarray(curve["time"], dtype=float)
    lines = [(np.asarray(curve[name], dtype=float), colour)
             for name, colour in (("measured", _MEASURED), ("predicted", _PREDICTED))]
    known = np.concatenate([line[np.isfinite(line)] for line, _ in lines])
    low, high = (known.min(), known.max()) if known.size else (0.0, 1.0)
    span = (high - low) or 1.0
    begin, length = (time[0], (time[-1] - time[0]) or 1.0) if time.size else (0.0, 1.0)
    plot = _HEIGHT - _BOTTOM
    step = max(1, len(time) // 1200)
    body = ""
    for values, colour in lines:
        points = " ".join(
            f"{_LEFT + (_WIDTH - 10 - _LEFT) * (t - begin) / length:.1f},"
            f"{plot - (plot - _TOP) * (v - low) / span:.1f}"
            for t, v in zip(time[::step], values[::step]) if np.isfinite(v))
        body += f"<polyline points='{points}' fill='none' stroke='{colour}'/>"
    return _frame(body, f"{curve['recording']}: {curve['channel']}, measured (grey), predicted",
                  "time [s]", curve["unit"], low, high, f"{length:.3g}")
