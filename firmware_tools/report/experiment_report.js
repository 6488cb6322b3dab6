// The page of `viewfix experiment --report`, after plot_page.js.
const ours = figures.methods[0];
const words = name => name.replaceAll('_', ' ');
const shareText = share => share ? `${percent(share.mean)} (${interval(share.ci95)})` : '–';
const paperTime = name => name in figures.paper.elapsed_ms
    ? `${figures.paper.times_ours[name] ?? 1} (${figures.paper.elapsed_ms[name]} ms)` : '–';
const paperShare = (kind, name) => percent(figures.paper[kind][name]);
const fixed = (value, digits) => isNumber(value) ? value.toFixed(digits) : '–';
const fixedInterval = (value, pair, digits, factor = 1) => isNumber(value)
    ? `${fixed(factor * value, digits)} (${fixed(factor * pair[0], digits)}–${fixed(factor * pair[1], digits)})` : '–';

// The paper's are paler.
const barsOf = (label, name, data) =>
    ({label, data, backgroundColor: colour(name) + (label.endsWith('paper') ? '55' : ''), borderColor: colour(name), borderWidth: 1});

// Table 2 and Fig. 5 of the paper.
function accuracies() {
  const section = card('Methods', 'Share right over all splits, with its 95 % bootstrap interval. The paper measured its own building; ' +
      'of its three multi-task rivals it gives no numbers but that MTL-SparseTrace ties in location and all lose in view.', true);
  const list = table(section, ['method', 'location', 'of the paper', 'view', 'of the paper', 'location, of its own view']);
  for (const m of figures.methods) {
    addRow(list, 'td', [words(m.name), shareText(m.location), paperShare('location', m.name), shareText(m.view),
                       paperShare('view', m.name), shareText(m.location_of_own_view)]);
  }
  const bars = [['location', 'blue', m => m.location], ['view', 'orange', m => m.view],
                ['location, paper', 'blue', m => ({mean: figures.paper.location[m.name]})],
                ['view, paper', 'orange', m => ({mean: figures.paper.view[m.name]})]];
  const names = figures.methods.map(m => words(m.name));
  plot(section, 'accuracy of the methods', () => ({
    type: 'bar',
    data: {labels: names,
           datasets: bars.map(([label, name, of]) => barsOf(label, name, figures.methods.map(m => of(m)?.mean ?? null)))},
    options: {indexAxis: 'y', scales: {x: share('share right'), y: nameAxis(names)}},
    plugins: [whiskers((bar, m) => bars[bar][2](figures.methods[m])?.ci95)]
  }), heightOf(names, 32));
}

// Table 3 of the paper.
function times() {
  const timed = figures.methods.concat({name: 'svm_one_vs_rest, by libsvm', paper: 'svm_one_vs_rest', ...figures.libsvm_itself})
      .filter(m => m.ms_per_prediction > 0);
  if (timed.length === 0) return;
  const section = card('Time for a prediction', 'From a histogram to a location, all methods in turn in one run on one core: medians, with ' +
      'their 95 % bootstrap intervals. svm one vs rest is collapsed to one vector a location, as ours is; libsvm itself sums over its ' +
      'support vectors. The paper: in brackets, what it measured for its 90 test images.', true);
  const list = table(section, ['method', 'µs a prediction', 'times ours', 'of the paper', 'multiply-adds', 'times ours']);
  for (const m of timed) {
    addRow(list, 'td', [
        words(m.name), fixedInterval(m.ms_per_prediction, m.ms_ci95, 2, 1000), fixedInterval(m.times_ours, m.times_ours_ci95, 2),
        paperTime(m.paper ?? m.name), Math.round(m.multiply_adds_per_prediction).toLocaleString('en'),
        fixed(m.multiply_adds_times_ours, 1)]);
  }
  const names = timed.map(m => words(m.name));
  plot(section, 'time for a prediction', () => ({
    type: 'bar',
    data: {labels: names,
           datasets: [{label: 'µs', data: timed.map(m => 1000 * m.ms_per_prediction), backgroundColor: colour('blue')}]},
    options: {indexAxis: 'y', scales: {x: axis('µs, logarithmic', {type: 'logarithmic'}), y: nameAxis(names)},
              plugins: {legend: {display: false}}},
    plugins: [whiskers((_, m) => timed[m].ms_ci95.map(ms => 1000 * ms))]
  }), heightOf(names, 26));
}

// Table 1 of the paper.
function byLocation() {
  const section = card('By location', words(ours.name) + '. The paper\'s locations are those that the built-in museum\'s are named after.', true);
  const paper = figures.paper.view_by_location;
  const list = table(section, ['location', 'location right', 'view right', 'of the paper']);
  for (const row of ours.by_location) {
    addRow(list, 'td', [row.name, shareText(row.location), shareText(row.view), percent(paper[row.name])]);
  }
  const bars = [['location', 'blue', row => row.location], ['view', 'orange', row => row.view],
                ['view, paper', 'orange', row => ({mean: paper[row.name]})]];
  const names = ours.by_location.map(row => row.name);
  plot(section, 'accuracy by location', () => ({
    type: 'bar',
    data: {labels: names,
           datasets: bars.map(([label, name, of]) => barsOf(label, name, ours.by_location.map(row => of(row)?.mean ?? null)))},
    options: {indexAxis: 'y', scales: {x: share('share right'), y: nameAxis(names)}},
    plugins: [whiskers((bar, i) => bars[bar][2](ours.by_location[i])?.ci95)]
  }), heightOf(names, 32));
}

function confusion() {
  const cells = ours.confusion.flatMap((row, truth) => row.map((images, guess) => (
      {true: figures.locations[truth], guess: figures.locations[guess] ?? null, images}))).filter(cell => cell.images > 0);
  confusionMatrix(card('Confusion', words(ours.name) + ', all splits together. The paper: ' +
      `${figures.paper.location_errors.images} of its images, between ${figures.paper.location_errors.between.map(words).join(' and ')}.`, true), cells);
}

// Fig. 4a of the paper.
function scores() {
  const shown = figures.scores;
  if (!shown) return;
  const section = card('Scores', `Test images of ${shown.location} under its models and those of the two locations most like it. ` +
      `Framed: the right location and view; it is the highest of all for ${shown.right_cell_highest} of ${shown.rows.length}, in the paper ` +
      `for ${figures.paper.right_cell_highest.images} of ${figures.paper.right_cell_highest.of}.`, true);
  const list = table(section, ['image', ...shown.columns.map(c => `${c.location} ${c.view ?? ''}`)]);
  list.id = 'scores';
  const all = shown.rows.flatMap(row => row.scores);
  const [low, high] = [Math.min(...all), Math.max(...all)];
  for (const row of shown.rows) {
    const line = addRow(list, 'td', [row.image]);
    row.scores.forEach((score, i) => {
      const cell = add(line, 'td', score.toFixed(2), 'number');
      cell.style.background = `color-mix(in srgb, var(--blue) ${Math.round(60 * (score - low) / (high - low || 1))}%, transparent)`;
      if (shown.columns[i].location === shown.location && shown.columns[i].view === row.view) cell.classList.add('own');
    });
  }
}

heading('The paper\'s experiment on ' + data.title.set,
        `${figures.images} images, ${figures.locations.length} locations, ${figures.splits} split(s), ${figures.words} words`);
accuracies();
times();
byLocation();
confusion();
scores();
