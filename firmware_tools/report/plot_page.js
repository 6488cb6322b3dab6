// What the pages with plots share; data's `figures` are what --json writes.
// Every name of a place or a file becomes text by textContent, never markup.
const data = JSON.parse(document.getElementById('data').textContent);
const figures = data.figures;
const charts = [];

function add(parent, tag, text, className) {
  const element = document.createElement(tag);
  if (text !== undefined && text !== null) element.textContent = text;
  if (className) element.className = className;
  parent.append(element);
  return element;
}
function card(heading, explanation, wide) {
  const section = add(document.getElementById('cards'), 'section', null, wide ? 'card wide' : 'card');
  add(section, 'h2', heading);
  if (explanation) add(section, 'p', explanation, 'quiet');
  return section;
}
function heading(title, of) {
  document.title = title;
  document.getElementById('title').textContent = title;
  document.getElementById('of').textContent = of;
}
// A table that scrolls in its own box; with `heads`, if any, as its first row, and rows of one line.
function table(parent, heads) {
  const element = add(add(parent, 'div', null, 'scroll'), 'table', null, heads ? 'list' : '');
  if (heads) addRow(element, 'th', heads);
  return element;
}
// A row of texts, or of [text, class].
function addRow(element, tag, contents) {
  const row = add(element, 'tr');
  for (const content of contents) add(row, tag, ...[content].flat());
  return row;
}
const isNumber = value => typeof value === 'number';
const percent = value => isNumber(value) ? (100 * value).toFixed(1) + '\u00a0%' : '–';
const interval = pair => Array.isArray(pair) ? `${(100 * pair[0]).toFixed(1)}–${(100 * pair[1]).toFixed(1)}\u00a0%` : '';
const milliseconds = value => isNumber(value) ? value.toFixed(1) + ' ms' : '–';

// Plots: made again whenever the colours change.
function colour(name) { return getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim(); }
function plot(section, name, make, height = 300) {
  const frame = add(section, 'div', null, 'plot');
  frame.style.height = `${height}px`;
  const canvas = add(frame, 'canvas');
  canvas.setAttribute('role', 'img');
  canvas.setAttribute('aria-label', name);
  const entry = {name, canvas, chart: null, draw() {
    if (entry.chart) entry.chart.destroy();
    Chart.defaults.color = colour('quiet');
    Chart.defaults.borderColor = colour('line');
    Chart.defaults.font.family = 'system-ui, sans-serif';
    Object.assign(Chart.defaults.plugins.legend.labels, {usePointStyle: true, boxHeight: 9, generateLabels: legendLabels});
    Chart.defaults.elements.bar.pointStyle = 'rect';
    const config = make(frame);
    config.options = {animation: false, maintainAspectRatio: false, ...config.options};
    entry.chart = new Chart(canvas, config);
  }};
  charts.push(entry);
}
// Chart.js' own, with the lines as they are in the plot; without those that have no name.
const chartLegendLabels = Chart.defaults.plugins.legend.labels.generateLabels;
function legendLabels(chart) {
  return chartLegendLabels(chart).filter(item => item.text).map(item => {
    const {borderColor, borderDash, borderWidth} = chart.data.datasets[item.datasetIndex];
    return {...item, lineDash: borderDash ?? [], lineWidth: borderWidth ?? (borderColor ? 2 : 0)};
  });
}
// A plugin that draws intervals over the bars: of(dataset, index) is [low, high], or nothing.
const whiskers = of => ({afterDatasetsDraw(chart) {
  const {ctx} = chart;
  ctx.save();
  ctx.strokeStyle = colour('text');
  ctx.beginPath();
  chart.data.datasets.forEach((dataset, d) => chart.getDatasetMeta(d).data.forEach((bar, i) => {
    const pair = chart.isDatasetVisible(d) && of(d, i);
    if (!Array.isArray(pair)) return;
    const scale = bar.horizontal ? chart.scales.x : chart.scales.y;
    const [low, high] = pair.map(value => scale.getPixelForValue(value));
    ctx.moveTo(...(bar.horizontal ? [low, bar.y] : [bar.x, low]));
    ctx.lineTo(...(bar.horizontal ? [high, bar.y] : [bar.x, high]));
  }));
  ctx.stroke();
  ctx.restore();
}});
const drawAll = () => charts.forEach(entry => entry.draw());
const axis = (text, options) => ({title: {display: true, text}, ...options});
// For bars that lie under each other: their names, and the height that all need.
const shortened = name => name.length > 23 ? '…' + name.slice(-22) : name;
const nameAxis = names => ({ticks: {autoSkip: false, callback: (_, i) => shortened(names[i])}});
const heightOf = (names, pixelsEach) => 90 + names.length * pixelsEach;
const share = text => axis(text, {min: 0, max: 1, ticks: {callback: value => Math.round(100 * value) + ' %'}});
const nameOf = location => location || 'no guess';

// Cells {true, guess, images}, those that occur; a guess of null: none.
function confusionMatrix(section, cells) {
  const names = [...new Set(cells.flatMap(c => [c.true, nameOf(c.guess)]))].sort();
  const wrong = cells.filter(c => c.true !== c.guess).sort((a, b) => b.images - a.images);
  if (names.length > 30) return confusionList(section, wrong);
  add(section, 'p', 'Rows: where the image was taken. Columns: the best guess.', 'quiet');
  const count = new Map(cells.map(c => [c.true + '\n' + nameOf(c.guess), c.images]));
  const matrix = table(section);
  matrix.id = 'matrix';
  const head = add(add(matrix, 'thead'), 'tr');
  add(head, 'th');
  names.forEach(name => add(add(head, 'th'), 'span', name));
  for (const truth of names.filter(name => cells.some(c => c.true === name))) {
    const line = addRow(matrix, 'th', [[truth, 'row']]);
    const total = cells.filter(c => c.true === truth).reduce((sum, c) => sum + c.images, 0);
    for (const guess of names) {
      const images = count.get(truth + '\n' + guess) ?? 0;
      const cell = add(line, 'td', images || '');
      if (images) cell.style.background =
          `color-mix(in srgb, var(${truth === guess ? '--green' : '--red'}) ${20 + 40 * images / total}%, transparent)`;
    }
  }
}
function confusionList(section, wrong) {
  add(section, 'p', wrong.length > 40 ? `The 40 most frequent of ${wrong.length} confusions.` : 'All confusions.', 'quiet');
  const list = table(section, ['taken at', 'best guess', ['images', 'number']]);
  for (const c of wrong.slice(0, 40)) addRow(list, 'td', [c.true, nameOf(c.guess), [c.images, 'number']]);
}

matchMedia('(prefers-color-scheme: dark)').addEventListener('change', drawAll);
window.addEventListener('resize', drawAll);
matchMedia('print').addEventListener('change', drawAll);
