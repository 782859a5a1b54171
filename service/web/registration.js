/** A scan on its design: the verdict, the figures, the part. */

import * as centres from './centres.js';
import { $, element, figure, fill } from './dom.js';
import * as part from './part.js';
import { DECISION, DECISION_MOOD, MEANING, MOOD, PASSED, alignment, mm, percent, short, signed, standsFor } from './words.js';

const PROBABILITIES = { same_part: 'the scan is of this design', pose: 'the pose is right, if it is' };

export async function show(job, results, sizes, signal) {
  decide(results.inspection);
  judge(results.verdict);
  $('figures').replaceChildren(...figures(results));
  others(results);
  bySegment(results);
  $('viewer').hidden = !sizes.has('design.glb');
  const shown = sizes.has('design.glb') ? part.openRegistration(job.id, results, sizes, signal) : null;
  const opened = centres.open(job, results, shown && part.panel, sizes, signal);
  await Promise.all([shown, opened]);
}

/** Is the part accepted; results of earlier versions do not say. */
function decide(inspection) {
  $('decision').hidden = !inspection;
  if (!inspection) return;
  const { decision, reasons, checks, rule } = inspection;
  $('decision').className = DECISION_MOOD[decision];
  $('decided').textContent = `part: ${DECISION[decision]}`;
  $('reasons').replaceChildren(...reasons.map((each) => element('li', each)));
  $('checks').hidden = !checks.length;
  $('rule').textContent = rule ? `Decision rule: ${rule}.` : '';
  const shown = (value, unit) => (value === null ? '-' : unit === '1' ? percent(value) : signed(value));
  const error = ({ uncertainty, unit }) => (uncertainty === null ? '-' : unit === '1' ? percent(uncertainty) : mm(uncertainty));
  const rows = checks.map((check) => [
    check.name, shown(check.value, check.unit), error(check), shown(check.lower, check.unit), shown(check.upper, check.unit),
    element('span', PASSED[check.passed], { className: `status ${{ true: 'good', false: 'bad', null: 'warn' }[check.passed]}` }),
  ]);
  fill($('check-table'), ['Check', 'Value', 'Standard error', 'Lower limit', 'Upper limit', 'Result'], rows, [1, 2, 3, 4]);
}

function judge(verdict) {
  const { status, confidence, findings } = verdict;
  $('verdict').hidden = false;
  $('verdict').className = MOOD[status] ?? 'bad';
  $('status').textContent = alignment(status);
  $('confidence').textContent = confidence === 0 ? '' : `confidence ${probability(confidence)}`;
  $('meaning').textContent = MEANING[status];
  $('findings').replaceChildren(...findings.map((each) => element('li', `${each.code.replaceAll('_', ' ')}: ${each.detail}`)));
  why(verdict);
}

const probability = (value) => value?.toFixed(2) ?? 'not given';

/** The two probabilities and what each follows from; results of earlier versions have neither. */
function why(verdict) {
  const { evidence = [] } = verdict;
  $('why').hidden = !evidence.length;
  $('why-tables').replaceChildren(...Object.entries(PROBABILITIES).flatMap(([of, words]) => {
    const table = element('table');
    const rows = evidence.filter((each) => each.of === of).map((each) => [
      each.name.replaceAll('_', ' '), fixed(each.value), fixed(each.weight), contribution(each.contribution), each.detail,
    ]);
    fill(table, ['Evidence', 'Value', 'Weight', 'Contribution', 'What it measures'], rows, [1, 2, 3]);
    const title = `${of.replaceAll('_', ' ')}: ${probability(verdict[of])}`;
    return [element('h3', [title, element('small', ` probability that ${words}`)]), element('div', table, { className: 'wide' })];
  }));
}

/** 2 decimals, a true minus sign, no negative zero */
const fixed = (value) => (Math.abs(value) < 0.005 ? '0.00' : value.toFixed(2).replace('-', '−'));
function contribution(value) {
  if (fixed(value) === '0.00') return 'neither 0.00';
  return value > 0 ? `for +${fixed(value)}` : `against ${fixed(value)}`;
}

function figures(results) {
  return [...measured(results), ...ofScan(results)].map(figure);
}

function measured({ deviation, metrics, landmarks }) {
  if (!deviation) return [['landmarks', `${landmarks.design.length} on the design, ${landmarks.scan.length} on the scan`]];
  const found = [
    ['RMS deviation', mm(deviation.rms_mm)],
    ['mean ± SD', `${signed(deviation.mean_mm).slice(0, -3)} ± ${mm(deviation.sd_mm)}`],
    ['1 % to 99 %', `${signed(deviation.p01_mm).slice(0, -3)} to ${signed(deviation.p99_mm)}`],
  ];
  if (deviation.within !== null) found.push([`within ±${short(deviation.tolerance_mm)} mm`, percent(deviation.within)]);
  found.push(
    ['overlap · coverage', `${percent(metrics.scan_overlap)} · ${percent(metrics.design_coverage)}`],
    ['landmarks matched', String(landmarks.matches.length)],
    ['K ratio', metrics.k_ratio === null ? '-' : metrics.k_ratio.toPrecision(3)],
  );
  return found;
}

/** What the scan shows of the scanner; results of earlier versions do not have it. */
function ofScan({ scan }) {
  if (!scan) return [];
  return [
    ['scan noise, 1 sigma', mm(scan.noise_mm)],
    ['scanner accuracy, 1 sigma', scan.accuracy_mm === null ? 'not stated' : `${short(scan.accuracy_mm)} mm`],
    ['residual limit for ok', mm(scan.residual_limit_mm)],
    ['left out of the scan', percent(scan.left_out_share)],
  ];
}

function others({ alternatives, transform }) {
  $('others').hidden = !alternatives.length;
  const rejected = transform ? 'alternative pose' : 'rejected';
  $('others-title').textContent = transform ? 'Alternative poses' : 'Rejected poses';
  const rows = alternatives.map((each, k) => [
    String(k + 1), each.score.toPrecision(3), each.rmse_mm.toFixed(3),
    each.symmetry_of_design ? ['symmetry of the design', standsFor(each)].filter(Boolean).join(', ') : rejected,
  ]);
  fill($('others-table'), ['Number', 'Score', 'RMSE, mm', 'Type'], rows, [1, 2]);
}

function bySegment({ deviation, segments }) {
  const rows = deviation?.by_segment ?? [];
  $('by-segment').hidden = !rows.length;
  if (!rows.length) return;
  const centreOf = new Map(segments.design.centres.map((each) => [each.segment, each]));
  fill(
    $('by-segment-table'),
    ['Segment', 'Vertices', 'Mean, mm', 'SD, mm', 'RMS, mm', 'Least, mm', 'Most, mm'],
    rows.map((each) => [
      element('button', [centres.swatch(each.segment), ` ${each.segment}`], {
        type: 'button',
        title: `show segment ${each.segment} on the part`,
        onclick: () => part.panel.point('design', centreOf.get(each.segment).position_mm, true),
      }),
      String(each.n),
      ...[each.mean_mm, each.sd_mm, each.rms_mm, each.min_mm, each.max_mm].map((value) => value.toFixed(3)),
    ]),
    [1, 2, 3, 4, 5, 6],
  );
}
