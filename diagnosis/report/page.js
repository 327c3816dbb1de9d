'use strict';
// The traces of a report: one chart a channel of the recording chosen, its residuals below, all with
// one time axis and one cursor.
(function () {
  const traces = JSON.parse(document.getElementById('data').textContent).traces;
  const viewer = document.getElementById('viewer');
  if (!viewer || !traces.length) return;
  const charts = document.getElementById('charts');
  const menu = document.getElementById('recording');
  const range = document.getElementById('range');
  const kDashes = [null, [6, 3], null, [2, 2]];
  const kWidths = [2.8, 1.3, 1.2, 1.2];
  const kNames = ['--measured', '--before', '--after', '--other'];
  let shown = [];  // the dygraphs
  let link = null;
  let whole = [0, 1];

  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const number = (value) => value === null || value === undefined || Number.isNaN(value)
    ? '–' : Number(value.toPrecision(5)).toString();
  // At a tick, which is a round number: dygraphs writes 0.015 and 0.02 alike.
  const tick = (value) => {
    const round = Number(value.toPrecision(7)), size = Math.abs(round);
    return (size > 0 && size < 1e-3) || size >= 1e5 ? round.toExponential().replace('e+', 'e') : round.toString();
  };
  const seconds = (value) => Number(value.toPrecision(4)).toString();
  const element = (tag, className, text) => {
    const made = document.createElement(tag);
    if (className) made.className = className;
    if (text) made.textContent = text;
    return made;
  };
  const key = (trace) => (trace.kept_out ? 'k' : 'f') + trace.recording;
  // What a series is: the measurement, or the model before or after.
  const style = (name, index) => name === 'predicted after' || name === 'left after' ? 2
    : name === 'predicted before' || name === 'left before' || name === 'left' ? 1 : index;

  function write_legend(box, names, colours, values) {
    box.textContent = '';
    names.forEach((name, i) => {
      const entry = element('span');
      const kind = style(name, i);
      const swatch = element('span', 'swatch' + (kDashes[kind] ? ' dashed' : '') + (kind === 0 ? ' wide' : ''));
      swatch.style.borderColor = colours[i];
      entry.append(swatch, name + (values ? ' ' + number(values[i]) : ''));
      box.append(entry);
    });
  }

  function colours_of(names) { return names.map((name, i) => colour(kNames[style(name, i)])); }

  function theme(names) {
    return {colors: colours_of(names), axisLineColor: colour('--soft'), gridLineColor: colour('--grid')};
  }

  function draw(parent, rows, names, unit, height, label, time_label) {
    const legend = element('div', 'legend');
    const plot = element('div', 'plot');
    plot.style.height = height + 'px';
    plot.tabIndex = 0;
    plot.setAttribute('role', 'img');
    plot.setAttribute('aria-label', label);
    parent.append(legend, plot);
    const series = {};
    names.forEach((name, i) => {
      const kind = style(name, i);
      series[name] = {strokePattern: kDashes[kind], strokeWidth: kWidths[kind]};
    });
    const chart = new Dygraph(plot, rows, Object.assign({
      labels: ['time'].concat(names), series: series, ylabel: unit, xlabel: time_label, legend: 'never',
      labelsDiv: element('div'), connectSeparatedPoints: false, drawPoints: false, highlightCircleSize: 3,
      axes: {y: {axisLabelWidth: 54, pixelsPerLabel: 22, valueFormatter: number, axisLabelFormatter: tick},
        x: {pixelsPerLabel: 56, valueFormatter: number, axisLabelFormatter: tick}},
      rightGap: 8,
      highlightCallback: (event, x) => point_at(x),
      unhighlightCallback: () => shown.forEach((other) => { other.legendOf(null); other.clearSelection(); }),
      drawCallback: (own, first) => { if (!first || !link) say_range(own); },
    }, theme(names)));
    chart.legendOf = (row) => write_legend(legend, names, colours_of(names), row === null ? null : rows[row].slice(1));
    chart.namesOf = names;
    chart.timesOf = rows.map((row) => row[0]);
    chart.legendOf(null);
    plot.addEventListener('keydown', (event) => {
      const todo = {ArrowLeft: 'back', ArrowRight: 'on', '+': 'in', '-': 'out', '0': 'reset'}[event.key];
      if (!todo) return;
      event.preventDefault();
      move(todo);
    });
    shown.push(chart);
  }

  // The row nearest to a time, by bisection.
  function nearest(times, x) {
    let low = 0, high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] < x) low = middle; else high = middle;
    }
    return x - times[low] < times[high] - x ? low : high;
  }

  // One cursor in all charts. Thinned channels may have other samples.
  function point_at(x) {
    shown.forEach((chart) => {
      const row = nearest(chart.timesOf, x);
      chart.legendOf(row);
      chart.setSelection(row);
    });
  }

  function say_range(chart) {
    const at = chart.xAxisRange();
    range.textContent = 'Shown: ' + seconds(at[0]) + ' to ' + seconds(at[1]) + ' s';
  }

  function residuals(rows) {
    return rows.map((row) => [row[0]].concat(row.slice(2).map(
      (value) => value === null || row[1] === null ? null : row[1] - value)));
  }

  function show(wanted) {
    if (link) link.detach();
    link = null;
    shown.forEach((chart) => chart.destroy());
    shown = [];
    charts.textContent = '';
    traces.filter((trace) => key(trace) === wanted).forEach((trace) => {
      const box = element('div', 'chart');
      box.append(element('h3', '', trace.channel), element('p', 'words', trace.words));
      charts.append(box);
      const unit = trace.unit ? trace.unit : '';
      draw(box, trace.rows, trace.names, unit, 230, 'Chart: ' + trace.channel + ' of ' + trace.recording +
        ', measured and predicted, against time. ' + trace.words, '');
      if (trace.names.length > 1) {
        const names = trace.names.slice(1).map((name) => name.replace('predicted', 'left'));
        draw(box, residuals(trace.rows), names, unit, 150, 'Chart: measured less predicted ' + trace.channel +
          ' of ' + trace.recording + ' against time', 'time, s');
      }
    });
    if (shown.length > 1) link = Dygraph.synchronize(shown, {selection: false, zoom: true, range: false});
    if (shown.length) { whole = shown[0].xAxisExtremes(); say_range(shown[0]); }
  }

  function set_range(from, to) {
    if (!shown.length) return;
    shown[0].updateOptions({dateWindow: from === null ? null : [from, to]});
    if (from === null) shown.forEach((chart) => chart.resetZoom());
    say_range(shown[0]);
  }

  function move(what) {
    if (!shown.length) return;
    const at = shown[0].xAxisRange(), middle = (at[0] + at[1]) / 2, half = (at[1] - at[0]) / 2;
    if (what === 'reset') return set_range(null, null);
    const shift = {back: -half / 2, on: half / 2}[what] || 0;
    const wide = half * ({in: 0.5, out: 2}[what] || 1);
    if (2 * wide >= whole[1] - whole[0]) return set_range(null, null);
    const from = Math.min(Math.max(middle + shift - wide, whole[0]), whole[1] - 2 * wide);
    set_range(from, from + 2 * wide);
  }

  const known = [];
  traces.forEach((trace) => {
    if (known.includes(key(trace))) return;
    known.push(key(trace));
    const option = element('option', '', (trace.recording || 'recording') + (trace.kept_out ? ' (kept out of the fit)' : ''));
    option.value = key(trace);
    menu.append(option);
  });
  menu.addEventListener('change', () => show(menu.value));
  viewer.querySelectorAll('[data-do]').forEach((button) => button.addEventListener('click', () => move(button.dataset.do)));
  // A cell of a map of errors over time opens its time.
  document.querySelectorAll('[data-from]').forEach((cell) => cell.addEventListener('click', () => {
    const wanted = cell.dataset.recording;
    if (known.includes(wanted) && menu.value !== wanted) { menu.value = wanted; show(wanted); }
    set_range(Number(cell.dataset.from), Number(cell.dataset.to));
    viewer.scrollIntoView();
  }));
  const recolour = () => shown.forEach((chart) => { chart.updateOptions(theme(chart.namesOf), true); chart.resize(); chart.legendOf(null); });
  window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', recolour);
  document.documentElement.classList.add('live');
  viewer.hidden = false;
  show(known[0]);
  window.report = {charts: () => shown, traces: traces, move: move};
})();
