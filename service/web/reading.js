/** What a person says of a file that can be read in several ways: the part of the design, the columns of the scan.
 *  A job whose file was so offers the choice; the form of the next job then has what was said, and the reason.
 */

import { $ } from './dom.js';

const ASKS = [
  { field: 'design-part', hint: 'part-hint', key: 'design_part', offer: 'Choose the part of the design' },
  { field: 'columns', hint: 'columns-hint', key: 'columns', offer: 'State the columns of the scan' },
];

/** The options that are filled in. */
export function options() {
  const said = ASKS.map(({ field, key }) => [key, $(field).value.trim()]);
  return Object.fromEntries(said.filter(([, value]) => value));
}

export function clear() {
  $('reading').open = false;
  for (const { field, hint } of ASKS) {
    $(field).value = '';
    $(hint).hidden = true;
  }
}

/** On the page of a job: lead to the choice that its error or one of its warnings names. */
export function offer(job, notes) {
  const asked = ask(notes);
  $('offer').hidden = !asked || job.type !== 'registration';
  if (!asked) return;
  $('offer-link').textContent = asked.offer;
  $('offer-link').href = `#again-${job.id}`;
}

/** In the form, after a job: what was said for it, and why it should be said (anew). asked : its options; results : null of a job without */
export function show(job, asked, results) {
  if (job.type !== 'registration') return;
  const notes = results?.warnings ?? (job.error ? [job.error] : []);
  for (const { field, key } of ASKS) $(field).value = asked[key] ?? '';
  $('reading').open = Object.keys(options()).length > 0;
  const open = explain(notes);
  if (open && job.error) $(open.field).focus();
}

/** A request that was refused for what was said here. */
export function refused(error) {
  const asked = explain([{ code: error.code, detail: error.message }]);
  if (asked) $(asked.field).focus();
}

function explain(notes) {
  const asked = ask(notes);
  if (!asked) return null;
  $('reading').open = true;
  $(asked.hint).textContent = notes.find((note) => isAbout(note, asked)).detail;
  $(asked.hint).hidden = false;
  return asked;
}

const ask = (notes) => ASKS.find((asked) => notes.some((note) => isAbout(note, asked)));
const isAbout = ({ detail }, { key }) => detail.includes(`options.${key}`);
