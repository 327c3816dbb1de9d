'use strict';
// Turns the poses of a mechanism: by dragging, by keys and by buttons.
(function () {
  const data = JSON.parse(document.getElementById('data').textContent);
  const element = (tag, className, text) => {
    const made = document.createElement(tag);
    if (className) made.className = className;
    if (text) made.textContent = text;
    return made;
  };
  const kStep = Math.PI / 12, kHighest = Math.PI / 2;

  function make_live(scene) {
    const svg = document.querySelector('svg[data-poses="' + scene.id + '"]'), figure = svg.closest('figure');
    const groups = [...svg.querySelectorAll('[data-pose]')];
    const floor = [...svg.querySelectorAll('.floor polyline')], labels = [...svg.querySelectorAll('.floor text')];
    const first = {azimuth: scene.azimuth, elevation: scene.elevation};
    const view = Object.assign({}, first);
    const place = (point) => {
      const [x, y, z] = point.map((value, k) => value - scene.centre[k]);
      const along = Math.cos(view.azimuth) * x + Math.sin(view.azimuth) * y;
      const right = -Math.sin(view.azimuth) * x + Math.cos(view.azimuth) * y;
      const up = -Math.sin(view.elevation) * along + Math.cos(view.elevation) * z;
      return (scene.width / 2 + scene.scale * right).toFixed(1) + ' ' + (scene.height / 2 - scene.scale * up).toFixed(1);
    };
    const move = (each, point) => each.setAttribute('transform', 'translate(' + place(point) + ')');
    function draw() {
      floor.forEach((line, k) => line.setAttribute('points', scene.floor[k].map(place).join(' ')));
      labels.forEach((label, k) => move(label, scene.labels[k]));
      groups.forEach((group) => {
        const points = scene.poses[Number(group.dataset.pose)].points;
        group.querySelector('polyline').setAttribute('points', points.map(place).join(' '));
        [...group.querySelectorAll('.joint')].forEach((joint, k) => move(joint, points[k]));
        move(group.querySelector('.tip'), points[points.length - 1]);
      });
    }
    function turn(right, up) {
      view.azimuth -= right;
      view.elevation = Math.min(Math.max(view.elevation + up, -0.2), kHighest);
      draw();
    }
    const steps = {ArrowLeft: [-kStep, 0], ArrowRight: [kStep, 0], ArrowUp: [0, kStep], ArrowDown: [0, -kStep]};
    svg.tabIndex = 0;
    svg.addEventListener('keydown', (event) => {
      if (!steps[event.key]) return;
      event.preventDefault();
      turn(...steps[event.key]);
    });
    let from = null;
    svg.addEventListener('pointerdown', (event) => { from = [event.clientX, event.clientY]; svg.setPointerCapture(event.pointerId); });
    svg.addEventListener('pointermove', (event) => {
      if (!from) return;
      turn((event.clientX - from[0]) / 120, (event.clientY - from[1]) / 120);
      from = [event.clientX, event.clientY];
    });
    ['pointerup', 'pointercancel'].forEach((when) => svg.addEventListener(when, () => { from = null; }));
    const tools = element('div', 'tools');
    [['Turn left', steps.ArrowLeft], ['Turn right', steps.ArrowRight], ['From above', steps.ArrowUp],
      ['From the side', steps.ArrowDown]].forEach(([text, step]) => {
      const button = element('button', '', text);
      button.type = 'button';
      button.addEventListener('click', () => turn(...step));
      tools.append(button);
    });
    const back = element('button', '', 'Back');
    back.type = 'button';
    back.addEventListener('click', () => { Object.assign(view, first); draw(); });
    tools.append(back, element('span', 'hint', 'Drag to turn, or use the arrow keys; press a name to hide its pose.'));
    svg.after(tools);
    figure.querySelectorAll('.key li').forEach((entry) => {
      const button = element('button', 'switch');
      button.type = 'button';
      button.setAttribute('aria-pressed', 'true');
      button.append(...entry.childNodes);
      entry.append(button);
      const group = groups.find((each) => each.dataset.series === entry.dataset.series);
      button.addEventListener('click', () => {
        const off = group.classList.toggle('off');
        button.setAttribute('aria-pressed', String(!off));
      });
      const light = (on) => () => { svg.classList.toggle('lit', on); group.classList.toggle('lit', on); };
      ['mouseenter', 'focus'].forEach((when) => button.addEventListener(when, light(true)));
      ['mouseleave', 'blur'].forEach((when) => button.addEventListener(when, light(false)));
    });
    return {scene: scene, view: view, turn: turn};
  }

  window.poses = (data.poses || []).map(make_live);
})();
