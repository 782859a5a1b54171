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

/** What stands in the form, {} for nothing. Throws an Error with words for a person. */
export function read() {
  const text = $('acceptance-json').value.trim();
  if (!text) return {};
  let found;
  try {
    found = JSON.parse(text);
  } catch (error) {
    throw new Error(`The limits are not JSON: ${error.message}.`);
  }
  if (typeof found !== 'object' || found === null || Array.isArray(found)) throw new Error('The limits must be a JSON object, as {"points": [...]}.');
  return found;
}
