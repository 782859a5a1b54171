"""The German of findings, evidence, reasons and checks. Keys are the templates in the code."""

GERMAN_FINDINGS: dict[str, str] = {
    # findings
    "only {share:.1%} of the scan lies within {distance:.3g} mm of the design; at least {required:.1%} is "
    "required: check that it is this part, and remove supports and background from the scan": (
        "nur {share} des Scans liegen höchstens {distance} mm vom Soll entfernt; mindestens {required} "
        "sind nötig: Zu prüfen ist, ob es dieses Teil ist; Stützen und Umgebung sind aus dem Scan zu "
        "entfernen"
    ),
    "the scan shows only {share:.1%} of the design; at least {required:.1%} is required: scan more of the "
    "part": (
        "der Scan zeigt nur {share} des Solls; mindestens {required} sind nötig: Es ist mehr von dem Teil "
        "zu scannen"
    ),
    "the scan is probably of another part (probability of this one: {probability}): it lies {rms:.3g} mm "
    "off the design (RMS), its normals agree with the design's to {agreement:.0%} (mean cosine), and its "
    "shape differs by {shape:.3g} mm (RMS over patches); verdict.evidence lists all that counts": (
        "der Scan zeigt wahrscheinlich ein anderes Teil (Wahrscheinlichkeit für dieses: {probability}): Er "
        "liegt {rms} mm neben dem Soll (RMS), seine Normalen stimmen zu {agreement} mit denen des Solls "
        "überein (mittlerer Kosinus), und seine Form weicht um {shape} mm ab (RMS über Flecken); "
        "verdict.evidence nennt alles, was zählt"
    ),
    "the scan lies {rms:.3g} mm off the design (RMS, each distance counted as at most {distance:.3g} mm); "
    "the limit for ok is {limit:.3g} mm: an inaccurate scan, or a part that differs from the design": (
        "der Scan liegt {rms} mm neben dem Soll (RMS, jeder Abstand höchstens als {distance} mm gezählt); "
        "die Grenze für ok ist {limit} mm: ein ungenauer Scan oder ein Teil, das vom Soll abweicht"
    ),
    "at {place} mm in the frame of the design, {area:.3g} mm² of the scan lie up to {depth:.3g} mm inside "
    "the design, more than noise and smooth distortion explain: check whether material is missing there": (
        "bei {place} mm im System des Solls liegen {area} mm² des Scans bis zu {depth} mm innerhalb des "
        "Solls, mehr, als Rauschen und glatte Verzeichnung erklären: Zu prüfen ist, ob dort Material fehlt"
    ),
    "at {place} mm in the frame of the design, {area:.3g} mm² of the scan lie up to {depth:.3g} mm off the "
    "design, more than noise and smooth distortion explain: check for excess material, supports or another "
    "version of the part": (
        "bei {place} mm im System des Solls liegen {area} mm² des Scans bis zu {depth} mm neben dem Soll, "
        "mehr, als Rauschen und glatte Verzeichnung erklären: Zu prüfen ist auf zu viel Material, Stützen "
        "oder eine andere Version des Teils"
    ),
    "at {place} mm in the frame of the design, {area:.3g} mm² of the design lie up to {depth:.3g} mm from "
    "the scan, which should show them: check whether material is missing there, or a hole was filled in "
    "the scan": (
        "bei {place} mm im System des Solls liegen {area} mm² des Solls bis zu {depth} mm vom Scan "
        "entfernt, der sie zeigen müsste: Zu prüfen ist, ob dort Material fehlt oder ein Loch im Scan "
        "gefüllt wurde"
    ),
    "at {place} mm in the frame of the design, the scan shows {area:.3g} mm² that {depth:.3g} mm of "
    "material of the design would hide: check whether this material is missing in the part": (
        "bei {place} mm im System des Solls zeigt der Scan {area} mm², die {depth} mm Material des Solls "
        "verdecken müssten: Zu prüfen ist, ob dieses Material am Teil fehlt"
    ),
    "compared with the design, the scan is {share:.1%} {longer} along {axis} than along {other}, more than "
    "printing and scanning explain; apart from that the shapes differ by {left:.2g} mm (RMS over patches): "
    "check that it is this version of the part, and see scale.per_axis": (
        "verglichen mit dem Soll ist der Scan entlang {axis} um {share} {longer} als entlang {other}, "
        "mehr, als Druck und Scan erklären; davon abgesehen weichen die Formen um {left} mm ab (RMS über "
        "Flecken): Zu prüfen ist, ob es diese Version des Teils ist; siehe scale.per_axis"
    ),
    "less than {share:.1%}": "weniger als {share}",
    "longer": "länger",
    "shorter": "kürzer",
    "the scan is {share:.1%} {larger} than the design in all directions, more than printing and scanning "
    "explain: another size of the part, or a wrong scale of the printer, the scanner or the file; see "
    "scale.isotropic": (
        "der Scan ist in allen Richtungen um {share} {larger} als das Soll, mehr, als Druck und Scan "
        "erklären: eine andere Größe des Teils oder ein falscher Maßstab von Drucker, Scanner oder Datei; "
        "siehe scale.isotropic"
    ),
    "larger": "größer",
    "smaller": "kleiner",
    "the scan is a flat piece ({thickness:.3g} mm RMS from a plane): it fits anywhere on a flat face of "
    "the design, and only its outline and its holes tell where; scan the part from another side too": (
        "der Scan ist ein ebenes Stück ({thickness} mm RMS von einer Ebene): Er passt überall auf eine "
        "ebene Fläche des Solls, und nur sein Umriss und seine Löcher zeigen, wohin; das Teil ist auch von "
        "einer anderen Seite zu scannen"
    ),
    "the evidence is not enough for ok, and the accuracy of the scanner was not stated: state it "
    "(options.scan_accuracy_mm), or scan the part from more sides; either may decide": (
        "die Belege reichen nicht für ok, und die Genauigkeit des Scanners wurde nicht angegeben: Sie ist "
        "anzugeben (options.scan_accuracy_mm), oder das Teil ist von mehr Seiten zu scannen; beides kann "
        "den Ausschlag geben"
    ),
    "the stated accuracy of the scanner, {accuracy:.3g} mm, is {share:.1%} of the diagonal of the design; "
    "a pose is confirmed up to {limit:.1%} only: use a more accurate scanner, or check the pose": (
        "die angegebene Genauigkeit des Scanners, {accuracy} mm, ist {share} der Diagonale des Solls; nur "
        "bis {limit} wird eine Lage bestätigt: Es ist ein genauerer Scanner zu verwenden oder die Lage zu "
        "prüfen"
    ),
    "the evidence is not enough for ok, although the accuracy of the scanner is stated; the scan shows "
    "{share:.0%} of the design: scan more sides if some are missing, else check that it is this part": (
        "die Belege reichen nicht für ok, obwohl die Genauigkeit des Scanners angegeben ist; der Scan "
        "zeigt {share} des Solls: Fehlende Seiten sind zu scannen, sonst ist zu prüfen, ob es dieses Teil "
        "ist"
    ),
    "no confidence is given: it holds for the default values of resample.enabled, landmarks, "
    "matching.length_share and registration.inlier_share only, and the settings of this job change one of "
    "them": (
        "es wird keine Konfidenz angegeben: Sie gilt nur für die Vorgaben von resample.enabled, landmarks, "
        "matching.length_share und registration.inlier_share, und die Einstellungen dieses Auftrags ändern "
        "eine davon"
    ),
    "the scan fits only when its numbers are multiplied by {factor:.6g} ({units}); transform and metrics "
    "refer to the scaled scan; set the unit in options.units and submit again": (
        "der Scan passt nur, wenn seine Zahlen mit {factor} multipliziert werden ({units}); Transformation "
        "und Kennzahlen gelten für den umgerechneten Scan; die Einheit ist in options.units anzugeben und "
        "der Auftrag neu zu senden"
    ),
    "multiplied by {factor:.6g} ({units}) the scan would lie on the design, but not as closely as a scan "
    "of the part; if that is its unit, set it in options.units and submit again": (
        "mit {factor} multipliziert ({units}) läge der Scan auf dem Soll, aber nicht so eng wie ein Scan "
        "des Teils; ist das seine Einheit, so ist sie in options.units anzugeben und der Auftrag neu zu "
        "senden"
    ),
    "inches read as mm": "Zoll, als mm gelesen",
    "mm read as inches": "mm, als Zoll gelesen",
    "cm read as mm": "cm, als mm gelesen",
    "mm read as cm": "mm, als cm gelesen",
    "metres read as mm": "Meter, als mm gelesen",
    "mm read as metres": "mm, als Meter gelesen",
    "the mirror image of the scan lies {mirrored:.3g} mm off the design (RMS), the scan itself {rms:.3g} "
    "mm: it was mirrored on export, or it is the opposite-hand part": (
        "das Spiegelbild des Scans liegt {mirrored} mm neben dem Soll (RMS), der Scan selbst {rms} mm: Er "
        "wurde beim Export gespiegelt, oder es ist das Teil der anderen Seite"
    ),
    "the mirror image of the scan lies {mirrored:.3g} mm off the design (RMS), the scan itself {rms:.3g} "
    "mm: it may be the opposite-hand part; check which hand it is": (
        "das Spiegelbild des Scans liegt {mirrored} mm neben dem Soll (RMS), der Scan selbst {rms} mm: Es "
        "kann das Teil der anderen Seite sein; zu prüfen ist, welches es ist"
    ),
    "the scan lies {rms:.3g} mm off the design (RMS), more than expected of a good scanner and printer: a "
    "rough scan, or a similar part; inspect the aligned meshes": (
        "der Scan liegt {rms} mm neben dem Soll (RMS), mehr als bei einem guten Scanner und Drucker zu "
        "erwarten: ein grober Scan oder ein ähnliches Teil; die ausgerichteten Netze sind anzusehen"
    ),
    "the {motion} {axis} is uncertain by {sigma:.3g} mm (1 sigma, RMS displacement of the scan); the limit "
    "is {limit:.3g} mm: scan more of the part, or accept it": (
        "die {motion} {axis} ist um {sigma} mm unsicher (1 Sigma, RMS-Verschiebung des Scans); die Grenze "
        "ist {limit} mm: Es ist mehr von dem Teil zu scannen oder die Unsicherheit hinzunehmen"
    ),
    "rotation about": "Drehung um",
    "translation along": "Verschiebung entlang",
    "screw motion about": "Schraubung um",
    "the design is symmetric, so this pose has equivalents that fit as well (number: {count}); "
    "alternatives has them as one row": (
        "das Soll ist symmetrisch, daher hat diese Lage gleichwertige, die ebenso gut passen (Anzahl: "
        "{count}); alternatives nennt sie in einer Zeile"
    ),
    "another pose, no symmetry of the design, has a score of {ratio:.2f}, where the best has 1 and higher "
    "is worse; compare the poses in alternatives": (
        "eine andere Lage, die keine Symmetrie des Solls ist, hat die Bewertung {ratio}; die beste hat 1, "
        "höher ist schlechter; die Lagen in alternatives sind zu vergleichen"
    ),
    "one motion of the scan is within its limit of uncertainty, but changes the fit very little: check the "
    "pose, and see observability": (
        "eine Bewegung des Scans liegt innerhalb ihrer Grenze der Unsicherheit, ändert die Passung aber "
        "kaum: Die Lage ist zu prüfen; siehe observability"
    ),
    "too few landmarks match ({count}) for a pose from landmarks alone, so rmse_landmarks_mm and k_ratio "
    "are null; the pose comes from {source}": (
        "zu wenige Landmarken stimmen überein ({count}), um daraus allein eine Lage zu bestimmen; "
        "rmse_landmarks_mm und k_ratio sind daher null; die Lage stammt aus: {source}"
    ),
    "pairs of landmarks": "Paare von Landmarken",
    "evenly distributed points": "gleichmäßig verteilte Punkte",
    "the principal axes": "die Hauptachsen",
    "ICP was still moving the scan after {count} iterations: raise registration.max_iterations, and check "
    "the pose": (
        "ICP bewegte den Scan nach {count} Iterationen noch: registration.max_iterations ist zu erhöhen "
        "und die Lage zu prüfen"
    ),
    # reasons of the decision, and its rule
    "no acceptance limits were stated (options.acceptance), so the part is not judged": (
        "es wurden keine Grenzen für die Annahme angegeben (options.acceptance); das Teil wird daher nicht "
        "bewertet"
    ),
    "the alignment is {status}, so the part is not judged": (
        "das Urteil über die Ausrichtung ist „{status}“; das Teil wird daher nicht bewertet"
    ),
    "the alignment of options.alignment was not applied, so the part is not judged: {why}": (
        "die Ausrichtung nach options.alignment wurde nicht angewandt, das Teil wird daher nicht bewertet: "
        "{why}"
    ),
    "it would move the part by {distance:.3g} mm from the automatic pose, which is farther than an "
    "alignment of the same pose can be; check its points and directions": (
        "sie würde das Teil um {distance} mm von der automatischen Lage bewegen, weiter, als eine "
        "Ausrichtung derselben Lage liegen kann; ihre Punkte und Richtungen sind zu prüfen"
    ),
    "its fit did not settle in {count} steps; the surfaces or points may leave a motion nearly free": (
        "ihre Einpassung kam in {count} Schritten nicht zur Ruhe; die Flächen oder Punkte lassen "
        "vielleicht eine Bewegung fast frei"
    ),
    "the scan shows too little of the surface that it fits": (
        "der Scan zeigt zu wenig von der Fläche, die sie einpasst"
    ),
    "the scan does not show its points {names}": "der Scan zeigt ihre Punkte nicht: {names}",
    "the matched landmarks that it uses ({count}) leave a motion free: {motion}": (
        "die zugeordneten Landmarken, die sie verwendet ({count}), lassen eine Bewegung frei: {motion}"
    ),
    "the translation along {axis}": "die Verschiebung entlang {axis}",
    "the {motion} the axis {axis} through {place} mm": "die {motion} die Achse {axis} durch {place} mm",
    "every motion": "jede Bewegung",
    "{check}: not measured, because the scan has too few points there": (
        "{check}: nicht gemessen, weil der Scan dort zu wenige Punkte hat"
    ),
    "{check}: {value} is nearer to its limit of {limit} than the stated uncertainty, so it neither passes "
    "nor fails": (
        "{check}: {value} liegt näher an der Grenze von {limit} als die angegebene Unsicherheit und ist "
        "daher weder erfüllt noch nicht erfüllt"
    ),
    "{check}: {value} is {side} its limit of {limit}": (
        "{check}: {value} liegt {side} der Grenze von {limit}"
    ),
    "{check}: the deviation of {value} is {side} its limit of {limit}, at {place} mm in the frame of the "
    "design": (
        "{check}: die Abweichung von {value} liegt {side} der Grenze von {limit}, bei {place} mm im System "
        "des Solls"
    ),
    "confidence: none is given with these settings; see the findings of the verdict": (
        "Konfidenz: mit diesen Einstellungen wird keine angegeben; siehe die Befunde des Urteils"
    ),
    "{check}: the deviation from its nominal length, {value}, is {side} its limit of {limit}": (
        "{check}: die Abweichung von der Soll-Länge, {value}, liegt {side} der Grenze von {limit}"
    ),
    "above": "über",
    "below": "unter",
    "simple acceptance: a value on or between its limits passes": (
        "einfache Annahme: Ein Wert auf oder zwischen seinen Grenzen ist in Ordnung"
    ),
    "ISO 14253-1 with an expanded uncertainty (k = 2) of {uncertainty:g} mm: a length passes if it is "
    "within its limits by at least that, fails if it is outside by more than that, and is not judged "
    "between; shares by simple acceptance": (
        "ISO 14253-1 mit einer erweiterten Unsicherheit (k = 2) von {uncertainty} mm: Eine Länge ist in "
        "Ordnung, wenn sie um mindestens so viel innerhalb ihrer Grenzen liegt, nicht in Ordnung, wenn sie "
        "um mehr außerhalb liegt, und dazwischen nicht bewertet; Anteile nach einfacher Annahme"
    ),
    # kinds of check
    "highest": "höchste Stelle",
    "lowest": "tiefste Stelle",
    "within": "innerhalb der Grenzen",
    "coverage": "Abdeckung",
    "confidence": "Konfidenz",
    "point": "Punkt",
    "distance": "Abstand",
    # evidence
    "residual": "Restabweichung",
    "detail": "Formunterschied",
    "normal agreement": "Übereinstimmung der Normalen",
    "matched landmarks": "zugeordnete Landmarken",
    "lead": "Vorsprung",
    "distinct lead": "Vorsprung vor anderen Formen",
    "mirror": "Spiegelbild",
    "RMS distance of the scan to the design beyond what the scanner explains, over 0.9 % of the diagonal "
    "(log10)": (
        "RMS-Abstand des Scans vom Soll über das hinaus, was der Scanner erklärt, bezogen auf 0,9 % der "
        "Diagonale (log10)"
    ),
    "difference of shape: RMS over patches of the signed distance without smooth distortion, over 0.2 % of "
    "the diagonal and the scanner's accuracy (log10)": (
        "Formunterschied: RMS des vorzeichenbehafteten Abstands über Flecken ohne glatte Verzeichnung, "
        "bezogen auf 0,2 % der Diagonale und die Genauigkeit des Scanners (log10)"
    ),
    "mean cosine between the normals of scan and design; 0 beyond the inlier distance": (
        "mittlerer Kosinus zwischen den Normalen von Scan und Soll; 0 jenseits des Inlier-Abstands"
    ),
    "share of the scan's landmarks that have their partner on the design": (
        "Anteil der Landmarken des Scans, die ein Gegenstück auf dem Soll haben"
    ),
    "score of the best other pose over that of this one (natural log, at most 2)": (
        "Kosten der besten anderen Lage, bezogen auf diese (natürlicher Logarithmus, höchstens 2)"
    ),
    "score of the best other pose at which the design does not repeat itself over that of this one "
    "(natural log, at most 2)": (
        "Kosten der besten anderen Lage, an der das Soll sich nicht wiederholt, bezogen auf diese "
        "(natürlicher Logarithmus, höchstens 2)"
    ),
    "residual of the mirrored scan over that of the scan (log10); 0: not tested": (
        "Restabweichung des gespiegelten Scans, bezogen auf die des Scans (log10); 0: nicht geprüft"
    ),
    "share of the design that the scan shows (log10)": "Anteil des Solls, den der Scan zeigt (log10)",
}
