// The page of `viewfix eval --report`, after plot_page.js.
const length = value => !isNumber(value) ? '–' : value < 1 ? (100 * value).toFixed(1) + '\u00a0cm' : value.toFixed(2) + '\u00a0m';
const hasPoses = figures.pose.labelled > 0;
const kPointRadius = 4;  // pixels
const kLowest = 120, kHighest = 500;  // pixels that a plan of positions is high
const degrees = value => isNumber(value) ? value.toFixed(2) + '°' : '–';

function summary() {
  const section = card('Summary', null);
  const columns = figures.sequence ? [['as a sequence', figures], ['each frame alone', figures.frame_alone]]
                                   : [['', figures]];
  const list = table(section);
  if (columns.length > 1) addRow(list, 'th', ['', ...columns.map(([name]) => name)]);
  const row = (name, value) => {
    const values = columns.map(([, of]) => value(of));
    if (values.every(text => text === null)) return;
    const line = addRow(list, 'th', [name]);
    values.forEach(text => add(line, 'td', text ?? '–'));
  };
  const withInterval = (value, pair) => percent(value) + (Array.isArray(pair) ? `  (95 %: ${interval(pair)})` : '');
  const pose = text => f => hasPoses ? text(f.pose) : null;
  row('images', f => `${f.images}` + (f.skipped ? `, ${f.skipped} skipped` : ''));
  row('location right', f => withInterval(f.location.accuracy, f.location.ci95));
  row('view right', f => f.view.labelled ? withInterval(f.view.accuracy, f.view.ci95) : null);
  row('by score alone', f => percent(f.score_alone.accuracy));
  row('by nearest keyframe', f => percent(f.nearest_keyframe.accuracy));
  row('right among the 5 / 20 best', f => `${percent(f.retrieval.recall_at['5'])} / ${percent(f.retrieval.recall_at['20'])}`);
  row('answered', f => percent(f.refusal.answered));
  row('of these wrong', f => withInterval(f.refusal.wrong_of_answered, f.refusal.wrong_ci95));
  row('tracked', f => 'tracked' in f ? percent(f.tracked) : null);
  row('unknown places answered', f => f.unknown ? `${percent(f.unknown.localized)} of ${f.unknown.images}` : null);
  row('pose found', pose(p => percent(p.localized)));
  row('median error', pose(p => `${length(p.median_translation_m)}, ${degrees(p.median_rotation_deg)}`));
  row('90 % within', pose(p => length(p.p90_translation_m)));
  for (const [name, text] of [['0.05m_2deg', '5 cm, 2°'], ['0.05m_5deg', '5 cm, 5°'], ['0.1m_5deg', '10 cm, 5°'], ['0.25m_2deg', '25 cm, 2°'],
                              ['0.5m_5deg', '50 cm, 5°'], ['5m_10deg', '5 m, 10°']]) {
    row('within ' + text, pose(p => percent(p.recall[name])));
  }
  row('calibration error (ECE)', f => withInterval(f.confidence.ece, f.confidence.ece_ci95));
  row('Brier score', f => isNumber(f.confidence.brier)
      ? `${f.confidence.brier.toFixed(3)}  (always the share right: ${f.confidence.brier_constant.toFixed(3)})` : null);
  row('wrong among the surest 80 %', f => percent(f.confidence.risk_at_80_coverage));
  row('time, median / 99 %', f => `${milliseconds(f.latency_ms.p50)} / ${milliseconds(f.latency_ms.p99)}`);
  row('model', f => (f.model_bytes / 1e6).toFixed(2) + ' MB');
}

function accuracyByLevel() {
  const levels = figures.location.by_level.length;
  if (levels === 0) return;
  const section = card('Accuracy by level',
      'Of slash-separated names: level 1 is the first part (a floor, say), the last level the whole name.');
  plot(section, 'accuracy by level', () => ({
    type: 'bar',
    data: {
      labels: Array.from({length: levels}, (_, i) => 'level ' + (i + 1)),
      datasets: [['best guess right', figures.location.by_level, 'blue'],
                 ['by score alone', figures.score_alone.by_level, 'grey'],
                 ['by nearest keyframe', figures.nearest_keyframe.by_level, 'orange'],
                 ['answered this far', figures.refusal.answered_by_level, 'green']]
          .map(([label, values, name]) => ({label, data: values, backgroundColor: colour(name)}))
    },
    options: {scales: {y: share('share of images')}}
  }));
}

function reliability() {
  const points = figures.confidence.reliability;
  if (points.length === 0) return;
  const section = card('Reliability', 'Answers grouped by confidence: on the diagonal, a confidence of 80 % is right ' +
      '80 % of the time. The band is the 95 % interval.');
  const line = (label, values, name, more) =>
      ({label, data: values, borderColor: colour(name), backgroundColor: colour(name), pointRadius: 0, clip: kPointRadius, ...more});
  const bound = side => points.map(p => ({x: p.confidence, y: p.right_ci95 ? p.right_ci95[side] : p.right}));
  plot(section, 'reliability', () => ({
    type: 'line',
    data: {datasets: [
      line('share right', points.map(p => ({x: p.confidence, y: p.right})), 'blue', {pointRadius: kPointRadius}),
      line('', bound(0), 'blue', {borderWidth: 1, borderDash: [2, 2]}),
      line('95 % interval', bound(1), 'blue', {borderWidth: 1, borderDash: [2, 2], fill: '-1', pointStyle: 'rect',
                                               backgroundColor: colour('blue') + '22'}),
      line('perfect', [{x: 0, y: 0}, {x: 1, y: 1}], 'grey', {borderDash: [6, 4], pointStyle: 'line'})]},
    options: {scales: {x: {type: 'linear', ...share('confidence')}, y: share('share right')}}
  }));
}

function riskCoverage() {
  const points = figures.confidence.risk_coverage;
  if (points.length === 0) return;
  const section = card('Risk and coverage',
      'If only the surest answers were given: how many are given, and how many of those are wrong.');
  plot(section, 'risk and coverage', () => ({
    type: 'line',
    data: {datasets: [{label: 'share wrong', data: points.map(p => ({x: p.coverage, y: p.risk})), borderColor: colour('red'),
                       backgroundColor: colour('red'), pointRadius: points.length > 40 ? 0 : 2, pointStyle: 'line',
                       clip: 2}]},
    options: {scales: {x: {type: 'linear', ...share('share of images answered')},
                       y: axis('share of them wrong', {min: 0, ticks: {callback: value => (100 * value).toFixed(1) + ' %'}})}}
  }));
}

function locations() {
  const rows = figures.locations;
  if (rows.length === 0) return;
  const section = card('Locations', 'Right: the best guess, answered or not. Wrong: of those answered. ' +
      'A location opens to its images.', true);
  const shown = rows.slice().sort((a, b) => a.right / a.images - b.right / b.images || b.wrong - a.wrong).slice(0, 40);
  const names = shown.map(r => r.location);
  plot(section, 'images by location', () => ({
    type: 'bar',
    data: {labels: names,
           datasets: [['right', 'green', r => r.right], ['not right', 'red', r => r.images - r.right]]
               .map(([label, name, of]) => ({label, data: shown.map(of), backgroundColor: colour(name)}))},
    options: {indexAxis: 'y', scales: {x: axis('images', {stacked: true, ticks: {precision: 0}}), y: {stacked: true, ...nameAxis(names)}}}
  }), heightOf(names, 22));
  if (rows.length > shown.length) add(section, 'p', `The ${shown.length} of ${rows.length} with the smallest share right.`, 'quiet');
  const heads = add(section, 'div', null, 'heads');
  for (const text of ['', 'images', 'right', 'answered', 'wrong']) add(heads, 'span', text);
  for (const r of rows) {
    const details = add(section, 'details', null, 'location');
    const line = add(details, 'summary');
    add(line, 'span', r.location);
    add(line, 'span', r.images);
    add(line, 'span', percent(r.right / r.images), r.right === r.images ? 'good' : '');
    add(line, 'span', r.answered);
    add(line, 'span', r.wrong, r.wrong ? 'bad' : '');
    details.addEventListener('toggle', () => framesOf(r.location, details), {once: true});
  }
}
function framesOf(location, details) {
  const heads = ['image', 'best guess', 'view', 'confidence', 'answered'];
  const list = table(details, hasPoses ? [...heads, 'position off', 'rotation off'] : heads);
  for (const f of figures.frames.filter(frame => frame.true_location === location)) {
    addRow(list, 'td', [
        f.path, [nameOf(f.location), f.location === f.true_location ? 'good' : 'bad'],
        [f.view, f.true_view && f.view !== f.true_view ? 'bad' : ''], percent(f.confidence),
        [f.localized ? (f.wrong ? 'yes, wrong' : 'yes') : 'no: ' + f.reasons.join(', '), f.localized && f.wrong ? 'bad' : ''],
        ...(hasPoses ? [length(f.translation_error_m), degrees(f.rotation_error_deg)] : [])]);
  }
}

function confusion() {
  if (figures.confusion.length > 0) confusionMatrix(card('Confusion', null, true), figures.confusion);
}

function failures() {
  const section = card('Worst failures', null, true);
  if (data.failures.length === 0) {
    add(section, 'p', 'None: no image was answered or guessed wrong.');
    return;
  }
  add(section, 'p', `${data.failures.length} of ${figures.failures.length}: wrong answers first, the surest first; then wrong ` +
      'guesses that were not answered. Lines join features of the image and the keyframe that look alike and agree with one motion ' +
      'of the camera, fifty at most.', 'quiet');
  for (const failure of data.failures) {
    const f = figures.frames[failure.frame];
    const block = add(section, 'div', null, 'failure');
    const off = isNumber(f.translation_error_m) ? `, position ${length(f.translation_error_m)} off` : '';
    add(block, 'p', f.localized ? `Answered with ${percent(f.confidence)} confidence${off}`
                                : `Not answered (${f.reasons.join(', ')}), confidence ${percent(f.confidence)}${off}`);
    const pairs = add(block, 'div', null, 'pairs');
    const query = {picture: failure.query, title: 'The image', location: placeOf(f.true_location, f.true_view), path: f.path};
    pair(pairs, query, {picture: failure.guess, title: 'Best guess', location: placeOf(nameOf(f.location), f.view), path: f.keyframe},
         failure.guess_matches, f.location === f.true_location ? 'green' : 'red');
    pair(pairs, query, {picture: failure.right, title: 'Nearest keyframe of the right place', location: f.true_location,
                        path: f.right_keyframe}, failure.right_matches, 'green');
  }
}
const placeOf = (location, view) => view ? `${location}, ${view}` : location;
// Two photographs side by side, and what was matched between them.
function pair(parent, query, keyframe, matches, name) {
  const figure = add(parent, 'figure');
  const sides = add(figure, 'div', null, 'sides');
  for (const {picture, title, path} of [query, keyframe]) {
    if (picture) {
      const image = add(sides, 'img');
      image.src = picture.url;
      image.alt = title;
    } else {
      add(sides, 'div', path ? 'no photograph' : 'none', 'none');
    }
  }
  if (query.picture && keyframe.picture) sides.append(matchLines(query.picture, keyframe.picture, matches, name));
  const captions = add(figure, 'figcaption', null, 'sides');
  for (const {title, location, path} of [query, keyframe]) {
    const caption = add(captions, 'div');
    add(caption, 'div', `${title}: ${location}`);
    if (path) add(caption, 'div', path, 'quiet');
  }
  if (query.picture && keyframe.picture && matches.length === 0) add(figure, 'div', 'No features that agree with one motion.', 'quiet');
}
// In units of a picture's width; the second picture begins at kSecond, as .sides has it.
function matchLines(first, second, matches, name) {
  const kSecond = 1.02;
  const element = (tag, attributes) => {
    const made = document.createElementNS('http://www.w3.org/2000/svg', tag);
    Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value));
    return made;
  };
  const [firstHeight, secondHeight] = [first.height / first.width, second.height / second.width];
  const svg = element('svg', {viewBox: `0 0 ${1 + kSecond} ${Math.max(firstHeight, secondHeight)}`, class: name});
  for (const [x1, y1, x2, y2] of matches) {
    const ends = {x1, y1: y1 * firstHeight, x2: kSecond + x2, y2: y2 * secondHeight};
    svg.append(element('line', ends), element('circle', {cx: ends.x1, cy: ends.y1, r: 0.008}),
               element('circle', {cx: ends.x2, cy: ends.y2, r: 0.008}));
  }
  return svg;
}

// Seen from above; where no floor plan says which axis is up, along the one in which the walk is flattest.
function trajectory() {
  const truths = figures.frames.filter(f => f.true_position);
  const found = figures.frames.filter(f => f.position);
  if (truths.length + found.length === 0) return;
  const all = truths.map(f => f.true_position).concat(found.map(f => f.position));
  const spread = [0, 1, 2].map(k => Math.max(...all.map(p => p[k])) - Math.min(...all.map(p => p[k])));
  const up = data.floor_plan ? 2 : spread.indexOf(Math.min(...spread));
  const [right, ahead] = [0, 1, 2].filter(k => k !== up);
  const at = position => ({x: position[right], y: position[ahead]});
  const links = figures.frames.filter(f => f.position && f.true_position)
      .flatMap(f => [at(f.position), at(f.true_position), {x: NaN, y: NaN}]);
  const plan = data.floor_plan && loadPlan(data.floor_plan);
  const section = card('Positions', (plan ? 'Over the floor plan. ' : '') + 'Where each image was taken and where it was found, ' +
      'joined by a line; poses of images that were not answered are there too.', true);
  plot(section, 'trajectory', frame => {
    const scales = equalScales(all.map(at), frame);
    return {
      type: 'scatter',
      data: {datasets: [
        {label: 'found', data: found.map(f => at(f.position)), backgroundColor: colour('orange'), pointRadius: 3},
        {label: 'true', data: truths.map(f => at(f.true_position)), borderColor: colour('blue'), backgroundColor: 'transparent',
         pointRadius: 5},
        {label: 'error', data: links, showLine: true, pointRadius: 0, pointStyle: 'line', borderWidth: 1, borderColor: colour('red')}]},
      options: {scales: {x: axis('xyz'[right] + ', m', scales.x), y: axis('xyz'[ahead] + ', m', scales.y)}},
      plugins: [{beforeDatasetsDraw: chart => plan && drawPlan(chart, plan)}]
    };
  });
}
// The ends of both axes, so that a metre is as long to the right as ahead in this frame, which is made as high as that takes.
function equalScales(points, frame) {
  const around = {x: 70, y: 100};  // pixels that axes and legend take
  const range = key => [Math.min(...points.map(p => p[key])), Math.max(...points.map(p => p[key]))];
  const spans = {x: range('x'), y: range('y')};
  const length = key => Math.max(1.1 * (spans[key][1] - spans[key][0]), 0.1);
  const width = Math.max(frame.clientWidth - around.x, 50);
  const height = Math.min(Math.max(width * length('y') / length('x'), kLowest), kHighest);
  frame.style.height = `${height + around.y}px`;
  const perPixel = Math.max(length('x') / width, length('y') / height);
  const ends = (key, pixels) => ({min: (spans[key][0] + spans[key][1] - perPixel * pixels) / 2,
                                  max: (spans[key][0] + spans[key][1] + perPixel * pixels) / 2,
                                  ticks: {includeBounds: false}});
  return {x: ends('x', width), y: ends('y', height)};
}
function loadPlan(plan) {
  const image = new Image();
  image.addEventListener('load', drawAll);
  image.src = plan.picture;
  return {image, ...plan};
}
// x = a px + b py + tx, y = b px - a py + ty.
function drawPlan(chart, plan) {
  if (!plan.image.complete || plan.image.naturalWidth === 0) return;
  const {ctx, chartArea: area, scales} = chart;
  const [a, b, tx, ty] = plan.site_from_pixel;
  const sx = scales.x.getPixelForValue(1) - scales.x.getPixelForValue(0);
  const sy = scales.y.getPixelForValue(1) - scales.y.getPixelForValue(0);
  ctx.save();
  ctx.beginPath();
  ctx.rect(area.left, area.top, area.width, area.height);
  ctx.clip();
  ctx.globalAlpha = 0.45;
  ctx.transform(sx * a, sy * b, sx * b, -sy * a, scales.x.getPixelForValue(tx), scales.y.getPixelForValue(ty));
  ctx.drawImage(plan.image, 0, 0, plan.width, plan.height);
  ctx.restore();
}

function latency() {
  const ms = figures.latency_ms;
  if (!isNumber(ms.p50)) return;
  const section = card('Time for a frame', 'On one core of the machine that evaluated; reading the image is not counted.');
  const stages = [...Object.entries(ms.stages), ['total', ms]];
  plot(section, 'latency by stage', () => ({
    type: 'bar',
    data: {labels: stages.map(([name]) => name),
           datasets: [['median', 'p50', 'blue'], ['95 %', 'p95', 'orange'], ['99 %', 'p99', 'grey']]
               .map(([label, key, name]) => ({label, data: stages.map(([, of]) => of[key]), backgroundColor: colour(name)}))},
    options: {scales: {y: axis('ms', {min: 0})}}
  }));
}

function modelBytes() {
  const sections = Object.entries(figures.model_sections).filter(([, bytes]) => bytes > 0);
  const rest = figures.model_bytes - sections.reduce((sum, [, bytes]) => sum + bytes, 0);
  if (rest > 0) sections.push(['other', rest]);
  const section = card('Bytes of the model', `${figures.model_bytes.toLocaleString('en')} in all.`);
  plot(section, 'model bytes by section', () => ({
    type: 'bar',
    data: {labels: sections.map(([name]) => name.replaceAll('_', ' ')),
           datasets: [{label: 'kB', data: sections.map(([, bytes]) => bytes / 1000), backgroundColor: colour('blue')}]},
    options: {indexAxis: 'y', scales: {x: axis('kB')}, plugins: {legend: {display: false}}}
  }));
}

heading('Evaluation of ' + data.title.model, `on ${data.title.set}, split ${data.title.split}; model ${data.title.hash}`);
if (data.title.map) {
  const link = document.createElement('a');
  link.textContent = 'The map in 3D';
  link.href = data.title.map;
  add(document.getElementById('of'), 'br').after(link);
}
summary();
accuracyByLevel();
reliability();
riskCoverage();
latency();
modelBytes();
locations();
confusion();
failures();
trajectory();
