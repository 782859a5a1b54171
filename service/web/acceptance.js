/** The limits of a new job as JSON, `options.acceptance`: typed in the form, or set by clicking on the design of an earlier job. */

import { $ } from './dom.js';

const LENGTHS = ['lower_mm', 'upper_mm', 'max_deviation_mm']; // fields of the form, and their keys
const SHARES = ['min_within', 'min_coverage', 'min_confidence'];
const drafts = new Map(); // of a design's blob -> JSON

/** Keep what was set on a design, for the next job on it. */
export function keep(blob, text) {
  if (text) drafts.set(blob, text);
  else drafts.delete(blob);
}

/** In the form of a job on the meshes of another: what was asked of that one, and what was set on its design since.
 *  asked : its `options.acceptance`, or null; elements : of the form */
export function show(job, asked, elements) {
  const drafted = drafts.get(job.inputs.design?.blob);
  const stated = joined(withoutNulls(asked ?? {}), drafted ? JSON.parse(drafted) : {});
  for (const name of LENGTHS) elements[name].value = taken(stated, name) ?? '';
  for (const name of SHARES) {
    const share = taken(stated, name);
    elements[name].value = share === undefined ? '' : Number((100 * share).toPrecision(6));
  }
  $('acceptance-json').value = Object.keys(stated).length ? written(stated) : '';
  $('acceptance-box').open = [...LENGTHS, ...SHARES.slice(1)].some((name) => elements[name].value) || Boolean($('acceptance-json').value);
}

/** As people read it: a vector on a line. */
export const written = (stated) => JSON.stringify(stated, null, 2).replace(/\[\s+(-?[\d.][^\]]*?)\s+\]/g, (_, inner) => `[${inner.replace(/\s+/g, ' ')}]`);

function taken(stated, name) {
  const value = stated[name];
  delete stated[name];
  return value;
}

/** What is set anew takes the place of what has its name. */
function joined(asked, drafted) {
  const found = { ...asked };
  for (const [list, items] of Object.entries(drafted)) {
    found[list] = [...(asked[list] ?? []).filter(({ name }) => !items.some((each) => each.name === name)), ...items];
  }
  return found;
}

/** A document without what it does not say. */
function withoutNulls(value) {
  if (Array.isArray(value)) return value.map(withoutNulls);
  if (typeof value !== 'object' || value === null) return value;
  const isSaid = ([, each]) => each !== null && !(Array.isArray(each) && !each.length);
  return Object.fromEntries(Object.entries(value).filter(isSaid).map(([key, each]) => [key, withoutNulls(each)]));
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
  for (const name of LENGTHS) if (elements[name].value) stated[name] = Number(elements[name].value);
  for (const name of SHARES) if (elements[name].value) stated[name] = Number(elements[name].value) / 100;
  return Object.keys(stated).length ? { acceptance: stated } : {};
}
