/** The limits of a new job as JSON, `options.acceptance`: typed in the form, or set by clicking on the design of an earlier job. */

import { $ } from './dom.js';

const drafts = new Map(); // of a design's blob -> JSON

/** Keep what was set on a design, for the next job on it. */
export function keep(blob, text) {
  if (text) drafts.set(blob, text);
  else drafts.delete(blob);
}

/** In the form of a job on the meshes of another. */
export function show(job) {
  const draft = drafts.get(job.inputs.design?.blob);
  if (!draft) return; // what a person types meanwhile stays
  $('acceptance-json').value = draft;
  $('acceptance-box').open = true;
}

export function clear() {
  $('acceptance-json').value = '';
  $('acceptance-box').open = false;
}

/** As `options`: the JSON of the form, and each field over the key of its name; {} for nothing. Throws an Error with words for a person. */
export function read(elements) {
  let stated = {};
  try {
    if (elements.acceptance.value.trim()) stated = JSON.parse(elements.acceptance.value);
  } catch (error) {
    throw new Error(`Regions, points and distances: not JSON (${error.message}).`);
  }
  if (typeof stated !== 'object' || stated === null || Array.isArray(stated)) throw new Error('Regions, points and distances: give a JSON object, as {"points": [...]}.');
  for (const name of ['lower_mm', 'upper_mm', 'max_deviation_mm']) if (elements[name].value) stated[name] = Number(elements[name].value);
  for (const name of ['min_within', 'min_coverage', 'min_confidence']) if (elements[name].value) stated[name] = Number(elements[name].value) / 100;
  return Object.keys(stated).length ? { acceptance: stated } : {};
}
