"""The German of findings, evidence, reasons and checks. Keys are the templates in the code."""

GERMAN_FINDINGS: dict[str, str] = {
    # findings
    "{share:.0%} of the scan lies within {distance:.3g} mm of the design; at least {required:.0%} is "
    "required": (
        "{share} des Scans liegen höchstens {distance} mm vom Soll entfernt; mindestens {required} sind nötig"
    ),
    "the scan covers {share:.1%} of the design; at least {required:.0%} is required": (
        "der Scan deckt {share} des Solls ab; mindestens {required} sind nötig"
    ),
    "the scan is of this design with probability {probability:.2g}: it lies {rms:.3g} mm off (RMS), its "
    "normals agree to {agreement:.0%}, and it differs in shape by {shape:.3g} mm (RMS over patches)": (
        "der Scan zeigt dieses Soll mit Wahrscheinlichkeit {probability}: Er liegt {rms} mm daneben (RMS), "
        "seine Normalen stimmen zu {agreement} überein, und seine Form weicht um {shape} mm ab (RMS über "
        "Flecken)"
    ),
    "the scan lies {rms:.3g} mm off the design (RMS, each distance counted as at most {distance:.3g} "
    "mm); the limit for ok is {limit:.3g} mm": (
        "der Scan liegt {rms} mm neben dem Soll (RMS, jeder Abstand höchstens als {distance} mm gezählt); "
        "die Grenze für ok ist {limit} mm"
    ),
    "a patch of {area:.3g} mm² of the scan lies up to {depth:.3g} mm inside the design, at {place} "
    "mm in the design's frame: more than noise and smooth distortion explain": (
        "ein Fleck von {area} mm² des Scans liegt bis zu {depth} mm innerhalb des Solls, bei {place} mm im "
        "System des Solls: mehr, als Rauschen und glatte Verzeichnung erklären"
    ),
    "a patch of {area:.3g} mm² of the scan lies up to {depth:.3g} mm off the design, at {place} mm "
    "in the design's frame: more than noise and smooth distortion explain": (
        "ein Fleck von {area} mm² des Scans liegt bis zu {depth} mm neben dem Soll, bei {place} mm im System "
        "des Solls: mehr, als Rauschen und glatte Verzeichnung erklären"
    ),
    "a patch of {area:.3g} mm² of the design lies up to {depth:.3g} mm off the scan, at {place} mm "
    "in the design's frame: it is missing in the scan, or covered": (
        "ein Fleck von {area} mm² des Solls liegt bis zu {depth} mm neben dem Scan, bei {place} mm im System "
        "des Solls: Er fehlt im Scan oder ist verdeckt"
    ),
    "a patch of {area:.3g} mm² of the scan lies behind {depth:.3g} mm of material of the design, at "
    "{place} mm in the design's frame: this material is missing in the scan": (
        "ein Fleck von {area} mm² des Scans liegt hinter {depth} mm Material des Solls, bei {place} mm im "
        "System des Solls: Dieses Material fehlt im Scan"
    ),
    "the scan is {share:.1%} {longer} than the design along {axis}, compared with another direction: "
    "a print and its scan do not explain this; without it the shapes differ by {left:.2g} mm (RMS "
    "over patches); see scale.per_axis": (
        "der Scan ist entlang {axis} um {share} {longer} als das Soll, verglichen mit einer anderen "
        "Richtung: Druck und Scan erklären das nicht; davon abgesehen weichen die Formen um {left} mm ab "
        "(RMS über Flecken); siehe scale.per_axis"
    ),
    "longer": "länger",
    "shorter": "kürzer",
    "the scan is {share:.1%} {larger} than the design along all directions, more than a print "
    "shrinks: another size of the part, or a wrong scale; see scale.isotropic": (
        "der Scan ist in allen Richtungen um {share} {larger} als das Soll, mehr als ein Druck schrumpft: "
        "eine andere Größe des Teils oder ein falscher Maßstab; siehe scale.isotropic"
    ),
    "larger": "größer",
    "smaller": "kleiner",
    "the scan is flat to {thickness:.3g} mm (RMS): it fits on any flat face of its size, and only edges "
    "and holes show where; scan the part from another side too": (
        "der Scan ist bis auf {thickness} mm (RMS) eben: Er passt auf jede ebene Fläche seiner Größe, und "
        "nur Kanten und Löcher zeigen, wohin; das Teil ist auch von einer anderen Seite zu scannen"
    ),
    "state the accuracy of the scanner (options.scan_accuracy_mm), or scan the part from more sides: "
    "either may show whether the scan is of this part": (
        "die Genauigkeit des Scanners ist anzugeben (options.scan_accuracy_mm) oder das Teil von mehr Seiten "
        "zu scannen: Beides kann zeigen, ob der Scan von diesem Teil ist"
    ),
    "the stated accuracy of the scanner is {share:.1%} of the size of the design; below {limit:.0%} "
    "is needed to confirm the pose": (
        "die angegebene Genauigkeit des Scanners ist {share} der Größe des Solls; um die Lage zu bestätigen, "
        "muss sie unter {limit} liegen"
    ),
    "the scan shows {share:.0%} of the design, which is not enough to confirm the pose: scan the part "
    "from another side too": (
        "der Scan zeigt {share} des Solls; das reicht nicht, um die Lage zu bestätigen: Das Teil ist auch "
        "von einer anderen Seite zu scannen"
    ),
    "no confidence is given: its models hold for the default values of resample.enabled, landmarks, "
    "matching.length_share and registration.inlier_share only, and one of them was changed": (
        "es wird keine Konfidenz angegeben: Ihre Modelle gelten nur für die Vorgaben von resample.enabled, "
        "landmarks, matching.length_share und registration.inlier_share, und eine davon wurde geändert"
    ),
    "the scan fits only when its numbers are multiplied by {factor:.6g} ({units}); transform and metrics "
    "refer to the scaled scan; set the unit in options.units and submit again": (
        "der Scan passt nur, wenn seine Zahlen mit {factor} multipliziert werden ({units}); Transformation "
        "und Kennzahlen gelten für den umgerechneten Scan; die Einheit ist in options.units anzugeben und "
        "der Auftrag neu zu senden"
    ),
    "multiplied by {factor:.6g} ({units}) the scan would lie on the design, but not as closely as a scan "
    "of the part; if that is its unit, set it in options.units and submit again": (
        "mit {factor} multipliziert ({units}) läge der Scan auf dem Soll, aber nicht so eng wie ein Scan des "
        "Teils; ist das seine Einheit, so ist sie in options.units anzugeben und der Auftrag neu zu senden"
    ),
    "inches read as mm": "Zoll, als mm gelesen",
    "mm read as inches": "mm, als Zoll gelesen",
    "cm read as mm": "cm, als mm gelesen",
    "mm read as cm": "mm, als cm gelesen",
    "metres read as mm": "Meter, als mm gelesen",
    "mm read as metres": "mm, als Meter gelesen",
    "the mirror image of the scan lies {mirrored:.3g} mm off the design (RMS), the scan itself "
    "{rms:.3g} mm: it was mirrored on export, or it is the opposite-hand part": (
        "das Spiegelbild des Scans liegt {mirrored} mm neben dem Soll (RMS), der Scan selbst {rms} mm: Er "
        "wurde beim Export gespiegelt, oder es ist das Teil der anderen Seite"
    ),
    "the mirror image of the scan lies {mirrored:.3g} mm off the design (RMS), the scan itself "
    "{rms:.3g} mm: it may be the opposite-hand part": (
        "das Spiegelbild des Scans liegt {mirrored} mm neben dem Soll (RMS), der Scan selbst {rms} mm: Es "
        "kann das Teil der anderen Seite sein"
    ),
    "the scan lies {rms:.3g} mm off the design (RMS), more than expected of a good scanner and printer: "
    "a rough scan, or a similar part; inspect the aligned meshes": (
        "der Scan liegt {rms} mm neben dem Soll (RMS), mehr als bei einem guten Scanner und Drucker zu "
        "erwarten: ein grober Scan oder ein ähnliches Teil; die ausgerichteten Netze sind anzusehen"
    ),
    "the {motion} {axis} is uncertain by {sigma:.3g} mm (1 sigma); the limit is {limit:.3g} mm": (
        "die {motion} {axis} ist um {sigma} mm unsicher (1 Sigma); die Grenze ist {limit} mm"
    ),
    "rotation about": "Drehung um",
    "translation along": "Verschiebung entlang",
    "screw motion about": "Schraubung um",
    "equivalent poses besides this one, by a symmetry of the design: {count}; see symmetry": (
        "gleichwertige Lagen außer dieser durch eine Symmetrie des Solls: {count}; siehe symmetry"
    ),
    "another pose, not equivalent by symmetry, fits almost as well; see alternatives": (
        "eine andere Lage, die keine Symmetrie ist, passt fast ebenso gut; siehe alternatives"
    ),
    "the surfaces constrain one of the six degrees of freedom only weakly; check the pose": (
        "die Flächen legen einen der sechs Freiheitsgrade nur schwach fest; die Lage ist zu prüfen"
    ),
    "too few landmarks match to determine a pose by landmarks alone: {count}; the pose was found by "
    "{source}": (
        "zu wenige Landmarken stimmen überein, um daraus allein eine Lage zu bestimmen: {count}; die Lage "
        "wurde gefunden durch {source}"
    ),
    "pairs of landmarks": "Paare von Landmarken",
    "evenly distributed points": "gleichmäßig verteilte Punkte",
    "the principal axes": "die Hauptachsen",
    "ICP had not converged after {count} iterations": "ICP war nach {count} Iterationen nicht konvergiert",
    # reasons of the decision, and its rule
    "no limits to accept the part by were given; state them in options.acceptance": (
        "es wurden keine Grenzen für die Annahme des Teils angegeben (options.acceptance)"
    ),
    "the alignment is {status}, so the part cannot be judged": (
        "das Urteil über die Ausrichtung ist „{status}“; das Teil kann daher nicht bewertet werden"
    ),
    "the alignment was not applied: {why}": "die Ausrichtung wurde nicht angewandt: {why}",
    "it would move the part by {distance:.3g} mm, to another pose than the one that was judged": (
        "sie würde das Teil um {distance} mm bewegen, in eine andere Lage als die beurteilte"
    ),
    "it did not converge in {count} steps": "sie ist in {count} Schritten nicht konvergiert",
    "the scan shows too little of what is fitted": "der Scan zeigt zu wenig von dem, was eingepasst wird",
    "the scan does not show {names}": "der Scan zeigt {names} nicht",
    "a motion stays free with {count} matched landmarks: {motion}": (
        "mit {count} zugeordneten Landmarken bleibt eine Bewegung frei: {motion}"
    ),
    "the translation along {axis}": "die Verschiebung entlang {axis}",
    "the {motion} the axis {axis} through {place} mm": "die {motion} die Achse {axis} durch {place} mm",
    "every motion": "jede Bewegung",
    "{check}: not measured, the scan does not show it": (
        "{check}: nicht gemessen, der Scan zeigt die Stelle nicht"
    ),
    "{check}: {value} is too near its limit of {limit} for the stated uncertainty": (
        "{check}: {value} liegt für die angegebene Unsicherheit zu nah an der Grenze von {limit}"
    ),
    "{check}: {value} is {side} its limit of {limit}": "{check}: {value} liegt {side} der Grenze von {limit}",
    "{check}: {value} is {side} its limit of {limit} at {place} mm": (
        "{check}: {value} liegt {side} der Grenze von {limit}, bei {place} mm"
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
    "score of the best other pose at which the design does not repeat itself over that of this one (natural "
    "log, at most 2)": (
        "Kosten der besten anderen Lage, an der das Soll sich nicht wiederholt, bezogen auf diese "
        "(natürlicher Logarithmus, höchstens 2)"
    ),
    "residual of the mirrored scan over that of the scan (log10); 0: not tested": (
        "Restabweichung des gespiegelten Scans, bezogen auf die des Scans (log10); 0: nicht geprüft"
    ),
    "share of the design that the scan shows (log10)": "Anteil des Solls, den der Scan zeigt (log10)",
}
