/** A scan on its design: the verdict, the figures, the part. */

import * as centres from './centres.js';
import { $, element, figure, fill } from './dom.js';
import * as part from './part.js';
import { ABOUT_POSE, DECISION, DECISION_MOOD, MOOD, PASSED, WITHOUT_POSE, alignment, meaning, mm, number, percent, short, signed, standsFor, time } from './words.js';

const PROBABILITIES = { same_part: 'the scan is of this design', pose: 'the pose is right, if it is' };

export async function show(job, results, sizes, signal) {
  decide(results.inspection);
  judge(results.verdict);
  identify(job, results);
  $('figures').replaceChildren(...figures(results).map(figure));
  $('how-figures').replaceChildren(...steps(results).map(explained));
  extremes(results.inspection);
  others(results);
  bySegment(results);
  $('how').hidden = false;
  $('how').open = false;
  $('viewer').hidden = !sizes.has('design.glb');
  $('measure').hidden = $('viewer').hidden;
  const shown = sizes.has('design.glb') ? part.openRegistration(job, results, sizes, signal) : null;
  const opened = centres.open(job, results, shown && part.panel, sizes, signal);
  await Promise.all([shown, opened]);
}

/** Is the part accepted; results of earlier versions do not say. */
function decide(inspection) {
  $('decision').hidden = !inspection;
  $('checks').hidden = !inspection?.checks.length;
  if (!inspection) return;
  const { decision, reasons, checks, rule } = inspection;
  $('decision').className = DECISION_MOOD[decision];
  $('decided').textContent = `part: ${DECISION[decision]}`;
  const passed = checks.filter((each) => each.passed === true).length;
  const none = rule && inspection.patch_mm === null ? 'No limit was judged: without a valid alignment nothing is measured. A new job on these meshes has the same limits.' : '';
  $('counts').textContent = checks.length ? `${passed} of ${checks.length} checks passed` : none;
  $('reasons').replaceChildren(...reasons.map((each) => element('li', each)));
  $('checks').open = decision === 'fail';
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
  $('meaning').textContent = meaning(verdict);
  // Without a pose the reason comes first; what is said of the pose that was rejected is not the reason.
  const isFolded = ({ code }) => WITHOUT_POSE.includes(status) && ABOUT_POSE.includes(code);
  const item = (each) => element('li', `${each.code.replaceAll('_', ' ')}: ${each.detail}`);
  $('findings').replaceChildren(...findings.filter((each) => !isFolded(each)).map(item));
  $('rejected-findings').replaceChildren(...findings.filter(isFolded).map(item));
  $('about-rejected').hidden = !findings.some(isFolded);
  $('about-rejected').open = false;
  why(verdict);
}

/** Which part this was, of which files, and when. */
function identify(job, { reference, provenance }) {
  const { more, ...named } = reference ?? { more: {} };
  const given = Object.entries({ ...named, ...more }).filter(([, value]) => value !== null && value !== undefined);
  const file = (name) => job.inputs[name]?.filename ?? `${provenance.inputs[name].sha256.slice(0, 12)} (SHA-256)`;
  const rows = [
    ...given.map(([key, value]) => [key.replaceAll('_', ' '), value]),
    ['design', `${file('design')}, read in ${provenance.inputs.design.unit}`],
    ['scan', `${file('scan')}, read in ${provenance.inputs.scan.unit}`],
    ['registered', time(job.finished)],
  ];
  $('identity').hidden = false;
  $('identity-list').replaceChildren(...rows.map(figure));
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
  if (fixed(value) === '0.00') return 'neutral 0.00';
  return value > 0 ? `for +${fixed(value)}` : `against ${fixed(value)}`;
}

/** What a person asks first: [name, value, what it is]. */
function figures({ deviation, metrics, deviation_of_design: ofDesign, scale }) {
  if (!deviation) return [];
  const { tolerance_mm: tolerance, within } = deviation;
  const coverage = ofDesign?.seen ?? metrics.design_coverage;
  const found = [
    ['min', signed(deviation.min_mm), 'lowest deviation of a vertex of the scan; below 0 material is missing'],
    ['max', signed(deviation.max_mm), 'highest deviation of a vertex of the scan; above 0 there is excess material'],
    [tolerance === null ? 'within tolerance' : `within ±${short(tolerance)} mm`, within === null ? 'no tolerance' : percent(within), 'share of the scanned area'],
    ['RMS', mm(deviation.rms_mm), 'root mean square of the deviation'],
    ['mean', signed(deviation.mean_mm), 'area-weighted mean of the deviation'],
    ['SD', mm(deviation.sd_mm), 'standard deviation about the mean'],
    ['coverage', percent(coverage), 'share of the area of the design that the scan shows, and that is counted'],
  ];
  return [...found, ...sizes(scale)];
}

const hundredths = (value) => (Math.abs(value) < 0.005 ? '0.00' : `${value > 0 ? '+' : '−'}${Math.abs(value).toFixed(2)}`);

/** The size of the scan over that of the design, and what a slicer asks for to make up for it. */
function sizes(scale) {
  const [whole, ...axes] = scale?.factors ?? []; // results of earlier versions have none
  if (![whole, ...axes].some((each) => each?.scale)) return [];
  const change = (each) => (each.scale === null ? 'not determined' : `${hundredths(100 * (each.scale - 1))} ± ${(196 * each.standard_error).toFixed(2)} %`);
  const factor = (each) => (each.scale === null ? '-' : `${each.slicer_percent.toFixed(2)} %`);
  const shown = (words) => [words(whole), element('small', axes.map((each) => `${each.axis} ${words(each)}`).join(', '))];
  const why = [whole, ...axes].filter((each) => each.reason).map((each) => `; ${each.axis}: ${each.reason}`).join('');
  return [
    ['size of the scan', shown(change), `compared with the design, along the axes of the design, with its 95 % interval; a diagnosis: the scan is never scaled${why}`],
    ['scale to set in the slicer (not applied here)', shown(factor), 'prints the part in its nominal size, if the printer repeats itself'],
  ];
}

/** Each number of the method: [name, value, what it is]. */
function steps({ metrics, landmarks, segments, scan, scale, deviation }) {
  const found = [
    ['landmarks', `${landmarks.design.length} on the design, ${landmarks.scan.length} on the scan, ${landmarks.matches.length} matched`, 'Places of distinct shape. Matched landmarks give the first pose.'],
    ['T²', landmarks.design.length ? `${short(landmarks.design[0].t2)} of the strongest landmark` : '-', 'Hotelling statistic: how far the shape around a vertex lies from that of its segment. Landmarks are its peaks.'],
    ['segments', `${segments.design.count} on the design, ${segments.scan?.count ?? 0} on the scan`, 'Regions around the density peaks of the decision graph.'],
    ['ρ, δ', `cut-off ${short(segments.design.d_c)} mm`, 'ρ: what lies within the cut-off distance of a vertex. δ: distance along the surface to the nearest vertex of larger ρ.'],
    ['RMSE as uploaded', mm(metrics.rmse_initial_mm), 'Distance of the scan to the design before any alignment.'],
    ['RMSE of the landmarks', mm(metrics.rmse_landmarks_mm), 'After alignment by the matched landmarks alone.'],
    ['RMSE without landmarks', mm(metrics.rmse_complete_mm), 'After ICP of the whole shape from the uploaded pose.'],
    ['K', metrics.k_ratio === null ? '-' : metrics.k_ratio.toPrecision(3), 'RMSE without landmarks over RMSE of the landmarks: above 1, landmarks helped.'],
    ['RMSE, final', mm(metrics.rmse_mm), 'After ICP from the best pose, over all vertices of the scan.'],
    ['inlier distance', mm(metrics.inlier_distance_mm), 'Up to here a point counts as lying on the other surface.'],
    ['overlap', percent(metrics.scan_overlap), 'Share of the scan within the inlier distance, without what lies at an open border of the design.'],
    ['scan on the design', percent(metrics.fitness), 'Share of the scan within the inlier distance, open borders included.'],
    ['design near the scan', percent(metrics.design_coverage), 'Share of the design within the inlier distance of the scan. The coverage above counts less: nothing at a border of the scan.'],
  ];
  if (deviation) found.push(['98 % of the area', `${number(deviation.p01_mm)} to ${signed(deviation.p99_mm)}`, 'Deviation between the 1 % and the 99 % quantile.']);
  if (scan) {
    found.push(
      ['scan noise', mm(scan.noise_mm), 'Scatter about the surface (1 sigma), from local surface fits.'],
      ['scanner accuracy', scan.accuracy_mm === null ? 'not stated' : `${short(scan.accuracy_mm)} mm`, '1 sigma, as stated for this job.'],
      ['residual limit for ok', mm(scan.residual_limit_mm), 'A scan that lies farther off (RMS) is not ok.'],
      ['left out of the scan', percent(scan.left_out_share), 'Stray pieces that are not the part.'],
    );
  }
  if (scale?.warp_mm !== null && scale?.warp_mm !== undefined) found.push(['residual deformation', mm(scale.warp_mm), 'RMS over patches after scaling by axis: warp.']);
  return found;
}

const explained = ([name, value, words]) => element('div', [element('dt', name), element('dd', [value, element('small', words)])]);

/** Where the surface deviates most; a click shows the place. */
function extremes(inspection) {
  const rows = (inspection?.extremes ?? []).map((each) => [
    element('button', signed(each.value_mm), { type: 'button', title: 'show the place on the part', onclick: () => part.panel.point('design', each.position_mm, true) }),
    each.uncertainty_mm === null ? '-' : mm(each.uncertainty_mm), short(each.area_mm2), String(each.segment),
    each.position_mm.map((axis) => axis.toFixed(1).replace('-', '−')).join(', '),
  ]);
  fill($('extreme-table'), ['Deviation', 'Standard error', 'Area, mm²', 'Segment', 'At x, y, z, mm'], rows, [1, 2, 3, 4]);
  $('patch-note').textContent = inspection?.patch_mm ? `Medians over patches of ${short(inspection.patch_mm)} mm diameter: one stray vertex does not count. min and max are single vertices.` : '';
}

function others({ alternatives, transform }) {
  $('others').hidden = !alternatives.length;
  const rejected = transform ? 'alternative pose' : 'rejected';
  $('others-title').textContent = transform ? 'Alternative poses' : 'Rejected poses';
  const rows = alternatives.map((each, k) => [
    String(k + 1), each.score.toPrecision(3), each.rmse_mm.toFixed(3),
    each.symmetry_of_design ? ['symmetry of the design', standsFor(each)].filter(Boolean).join(', ') : rejected,
  ]);
  fill($('others-table'), ['Number', 'Cost over that of the best', 'RMS, mm', 'Type'], rows, [1, 2]);
}

function bySegment({ deviation, segments }) {
  const rows = deviation?.by_segment ?? [];
  $('by-segment').hidden = !rows.length;
  if (!rows.length) return;
  const centreOf = new Map(segments.design.centres.map((each) => [each.segment, each]));
  fill(
    $('by-segment-table'),
    ['Segment', 'Vertices', 'Mean, mm', 'SD, mm', 'RMS, mm', 'Min, mm', 'Max, mm'],
    rows.map((each) => [
      element('button', [centres.swatch(each.segment), ` ${each.segment}`], {
        type: 'button',
        title: `show segment ${each.segment} on the part`,
        onclick: () => part.panel.point('design', centreOf.get(each.segment).position_mm, true),
      }),
      String(each.n),
      number(each.mean_mm), each.sd_mm.toFixed(3), each.rms_mm.toFixed(3), number(each.min_mm), number(each.max_mm),
    ]),
    [1, 2, 3, 4, 5, 6],
  );
}
