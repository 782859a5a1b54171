/** A study: what it says in words, its picture, its rows. */

import * as api from './api.js';
import { $, figure, fill } from './dom.js';
import { percent, short } from './words.js';

const number = (value) => (value === null ? '-' : Math.abs(value) >= 1e4 || (value && Math.abs(value) < 1e-3) ? value.toExponential(1) : short(value));
const TABLES = {
  informativeness: {
    head: ['Detector', 'ICP', 'Points', 'K > 1', 'Ties', 'K ≥ 10', 'K, median', 'RMSE complete, mm', 'RMSE landmarks, mm'],
    row: (each) => [each.detector, each.icp, String(each.points), percent(each.share_above), percent(each.share_tie), percent(each.share_at_least_10), number(each.k.p50), number(each.rmse_complete_mm.p50), number(each.rmse_landmarks_mm.p50)],
  },
  repeatability: {
    head: ['Detector', 'Condition', 'Points', 'Found again', 'By chance', 'Pose right', 'Pose error, mm'],
    row: (each) => [each.detector, each.condition, number(each.points), percent(each.mean), percent(each.chance), percent(each.pose_right), number(each.pose_error_mm.p50)],
  },
};

export async function show(job, results, sizes, signal) {
  const { kind, trials, count } = results.protocol;
  $('figures').replaceChildren(...[['study', kind], ['trials', String(trials)], ['points per detector', String(count)]].map(figure));
  $('study').hidden = false;
  $('summary').textContent = results.summary;
  const { head, row } = TABLES[kind];
  fill($('study-table'), head, results[kind].map(row), head.map((_, k) => k).slice(2));
  $('study-picture').hidden = !sizes.has('study.svg');
  if (!sizes.has('study.svg')) return;
  const picture = await api.blob(`/v1/jobs/${job.id}/files/study.svg`);
  if (signal.aborted) return;
  const address = URL.createObjectURL(picture);
  $('study-picture').onload = () => URL.revokeObjectURL(address);
  $('study-picture').src = address;
  $('study-picture').alt = `Plot of the study: ${results.summary}`;
}
