/** The form of a study: what it measures, with which detectors, and how often. */

import { $, element } from './dom.js';

/** What each landmark detector is, as pipeline/stages/detectors.py has them. */
const DETECTORS = {
  t2: 'T² (this method)', gaussian_curvature: 'Gaussian curvature', agd: 'average geodesic distance', hks: 'heat kernel signature',
  iss: 'ISS', gp: 'Gaussian process', farthest: 'farthest points', random: 'random points',
};
const TRIALS = { informativeness: 10_000, repeatability: 5 };
const box = $('study-fields');
const form = box.closest('form');

$('study-detectors').append(...Object.entries(DETECTORS).map(([value, words]) => {
  const tick = element('input', '', { type: 'checkbox', name: 'detectors', value, checked: true, defaultChecked: true });
  return element('label', [tick, ` ${words}`]);
}));
form.elements.kind.addEventListener('change', tell);
form.addEventListener('reset', () => setTimeout(tell));
tell();

/** type : of the job that the form is for */
export function dress(type) {
  box.hidden = type !== 'study';
  box.disabled = box.hidden; // a hidden field is not checked
}

function tell() {
  form.elements.trials.placeholder = String(TRIALS[form.elements.kind.value]);
  $('study-meaning').textContent = form.elements.kind.value === 'informativeness'
    ? 'Does an alignment by landmarks beat one of the whole shape? A trial moves each vertex and aligns the mesh with its original.'
    : 'Are the same places found again on another mesh of the same shape? A trial makes a scan of another triangulation, with noise, turned and cropped.';
}

/** options.study, as far as it is filled in. Throws without a detector. */
export function options() {
  const { kind, trials, count, noise_mm: noise } = form.elements;
  const detectors = [...box.querySelectorAll('[name=detectors]:checked')].map((each) => each.value);
  if (!detectors.length) throw new Error('Choose at least one landmark detector.');
  return {
    kind: kind.value,
    ...(detectors.length < Object.keys(DETECTORS).length ? { detectors } : {}),
    ...(trials.value ? { trials: Number(trials.value) } : {}),
    ...(count.value ? { count: Number(count.value) } : {}),
    ...(noise.value ? { noise_mm: Number(noise.value) } : {}),
  };
}

/** As for a job before; study : of the settings that its results state */
export function remember(study) {
  const { kind, trials, count, noise_mm: noise } = form.elements;
  kind.value = study.kind;
  trials.value = study.trials ?? '';
  count.value = study.count ?? '';
  noise.value = study.noise_mm ?? '';
  for (const tick of box.querySelectorAll('[name=detectors]')) tick.checked = study.detectors.includes(tick.value);
  tell();
}
