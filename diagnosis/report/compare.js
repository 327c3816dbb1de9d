'use strict';
// Tables that sort and filter, and charts whose curves can be hidden and read out.
(function () {
  const element = (tag, className, text) => {
    const made = document.createElement(tag);
    if (className) made.className = className;
    if (text) made.textContent = text;
    return made;
  };
  // The text of a cell without the sign and the small note.
  const words = (cell) => {
    const copy = cell.cloneNode(true);
    copy.querySelectorAll('.sign, small').forEach((each) => each.remove());
    return copy.textContent.trim();
  };
  const value = (cell) => !cell ? '' : cell.dataset.value !== undefined ? Number(cell.dataset.value) : words(cell);

  function compared(a, b) {
    if (typeof a === 'number' && typeof b === 'number') return a - b;
    if (typeof a === 'number') return -1;
    if (typeof b === 'number') return 1;
    return a.localeCompare(b, 'en', {numeric: true});
  }

  function sort(table, column, falls) {
    const body = table.tBodies[0], rows = [...body.rows];
    const keys = new Map(rows.map((row) => [row, value(row.cells[column])]));
    const missing = (key) => typeof key === 'number' ? Number.isNaN(key) : key === '' || key === '–';
    rows.sort((a, b) => {
      const left = keys.get(a), right = keys.get(b);
      if (missing(left) || missing(right)) return missing(left) - missing(right);  // at the end
      return falls ? compared(right, left) : compared(left, right);
    });
    body.append(...rows);
    [...table.tHead.rows[0].cells].forEach((head, k) => {
      head.setAttribute('aria-sort', k !== column ? 'none' : falls ? 'descending' : 'ascending');
    });
  }

  function make_sortable(table) {
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const button = element('button', 'sort', head.textContent);
      button.type = 'button';
      head.textContent = '';
      head.append(button);
      head.setAttribute('aria-sort', 'none');
      button.addEventListener('click', () => sort(table, column, head.getAttribute('aria-sort') === 'ascending'));
    });
  }

  function choice(head, rows, column, changed) {
    const label = element('label', '', head.textContent + ' ');
    const menu = element('select');
    menu.append(new Option('all', ''));
    [...new Set(rows.map((row) => words(row.cells[column])))].sort((a, b) => a.localeCompare(b, 'en', {numeric: true}))
      .forEach((each) => menu.append(new Option(each, each)));
    menu.addEventListener('change', changed);
    label.append(menu);
    return {label: label, holds: (row) => !menu.value || words(row.cells[column]) === menu.value};
  }

  // Menus for the columns that are choices, and a field for words that all must be in the row.
  function make_filter(table) {
    const rows = [...table.tBodies[0].rows];
    const tools = element('div', 'tools'), count = element('span', 'count'), field = element('input');
    const texts = new Map(rows.map((row) => [row, row.textContent.toLowerCase()]));
    count.setAttribute('role', 'status');
    field.type = 'search';
    const choices = [];
    const changed = () => {
      const wanted = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      let left = 0;
      rows.forEach((row) => {
        row.hidden = !(choices.every((each) => each.holds(row)) && wanted.every((word) => texts.get(row).includes(word)));
        left += row.hidden ? 0 : 1;
      });
      count.textContent = left + ' of ' + rows.length + ' rows';
    };
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      if (head.dataset.choice === undefined) return;
      const made = choice(head, rows, column, changed);
      choices.push(made);
      tools.append(made.label);
    });
    const label = element('label', '', 'words ');
    label.append(field);
    field.addEventListener('input', changed);
    tools.append(label, count);
    table.closest('.scroll').before(tools);
    changed();
  }

  const data = document.getElementById('data');
  const plots = data ? JSON.parse(data.textContent).plots || [] : [];

  const digits = (number, count) => Number(number.toPrecision(count)).toString();
  const written = (kind, number) => kind === 'share' ? digits(100 * number, 3) + ' %'
    : kind !== 'seconds' ? digits(number, 5)
    : number < 0.9995e-3 ? digits(1e6 * number, 3) + ' µs' : number < 0.9995 ? digits(1e3 * number, 3) + ' ms'
    : digits(number, 3) + ' s';

  // Every curve at one x: of steps the last before it, else the point that stands there.
  function values_at(plot, x, hidden) {
    const found = [];
    plot.series.forEach((series) => {
      if (hidden.has(series.name)) return;
      let at = -1;
      series.x.forEach((each, k) => { if (plot.steps ? each <= x : each === x) at = k; });
      if (at >= 0 && series.y[at] !== null) found.push([series.name, series.y[at]]);
    });
    return found.sort((a, b) => plot.y.number === 'share' ? b[1] - a[1] : a[1] - b[1]);
  }

  function make_live(plot) {
    const svg = document.querySelector('svg[data-plot="' + plot.id + '"]');
    const figure = svg.closest('figure'), hidden = new Set();
    const places = [...new Set(plot.series.flatMap((series) => series.x))].filter((x) => x !== null).sort((a, b) => a - b);
    const say = element('div', 'readout'), line = document.createElementNS(svg.namespaceURI, 'path');
    say.setAttribute('role', 'status');
    line.setAttribute('class', 'cursor');
    svg.append(line);
    svg.tabIndex = 0;
    let at = -1;
    const place = (x) => plot.x.from + ((plot.x.logarithmic ? Math.log10(x) : x) - plot.x.low) / (plot.x.high - plot.x.low) * (plot.x.to - plot.x.from);
    const read = (k) => {
      at = Math.min(Math.max(k, 0), places.length - 1);
      const x = place(places[at]).toFixed(1);
      line.setAttribute('d', 'M' + x + ' ' + plot.y.to + 'V' + plot.y.from);
      say.textContent = '';
      say.append(element('b', '', plot.x.label + ': ' + written(plot.x.number, places[at])));
      const list = element('ol');
      values_at(plot, places[at], hidden).forEach(([name, y]) => list.append(element('li', '', name + ' ' + written(plot.y.number, y))));
      say.append(list);
    };
    const read_near = (event) => {
      const box = svg.getBoundingClientRect(), x = (event.clientX - box.left) / box.width * svg.viewBox.baseVal.width;
      let best = 0;
      places.forEach((each, k) => { if (Math.abs(place(each) - x) < Math.abs(place(places[best]) - x)) best = k; });
      read(best);
    };
    svg.addEventListener('click', read_near);
    svg.addEventListener('pointermove', read_near);
    svg.addEventListener('keydown', (event) => {
      const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
      if (!step) return;
      event.preventDefault();
      read(at < 0 ? (step > 0 ? 0 : places.length - 1) : at + step);
    });
    const curves = [...svg.querySelectorAll('g[data-series]')];
    const show = () => {
      curves.forEach((curve) => curve.classList.toggle('off', hidden.has(curve.dataset.series)));
      if (at >= 0) read(at);
    };
    const entries = [...figure.querySelectorAll('.key li')];
    const buttons = entries.map((entry) => {
      const button = element('button', 'switch');
      button.type = 'button';
      button.setAttribute('aria-pressed', 'true');
      button.append(...entry.childNodes);
      entry.append(button);
      const name = entry.dataset.series;
      const curve = curves.find((each) => each.dataset.series === name);
      button.addEventListener('click', () => {
        if (!hidden.delete(name)) hidden.add(name);
        button.setAttribute('aria-pressed', String(!hidden.has(name)));
        show();
      });
      const light = (on) => () => { svg.classList.toggle('lit', on); if (curve) curve.classList.toggle('lit', on); };
      ['mouseenter', 'focus'].forEach((when) => button.addEventListener(when, light(true)));
      ['mouseleave', 'blur'].forEach((when) => button.addEventListener(when, light(false)));
      return button;
    });
    if (buttons.length > 2) {
      const all = element('div', 'tools');
      [['Show all', 'true'], ['Hide all', 'false']].forEach(([text, state]) => {
        const button = element('button', '', text);
        button.type = 'button';
        button.addEventListener('click', () => {
          hidden.clear();
          if (state === 'false') plot.series.forEach((series) => hidden.add(series.name));
          buttons.forEach((each) => each.setAttribute('aria-pressed', state));
          show();
        });
        all.append(button);
      });
      all.append(element('span', 'hint', 'Point at the chart, or use the arrow keys, to read values; press a name to hide its curve.'));
      figure.querySelector('.key').before(all);
    }
    svg.after(say);
    return {plot: plot, hidden: hidden, read: read};
  }

  document.querySelectorAll('table.sortable').forEach((table) => {
    if (table.tBodies[0].rows.length > 8) make_filter(table);
    make_sortable(table);
  });
  window.comparison = {plots: plots.map(make_live)};
})();
