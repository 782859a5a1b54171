"""The German words of the report. Keys are the English texts in the code; `{name}` stays as it is."""

GERMAN: dict[str, str] = {
    # head
    "Inspection report": "Prüfbericht",
    "Scan of a printed part, registered to its design": (
        "Scan eines gedruckten Teils, ausgerichtet auf das Soll"
    ),
    "Study: {kind}": "Studie: {kind}",
    "How useful the landmarks are for registration": "Nutzen der Landmarken für die Ausrichtung",
    "{segments} segments, {landmarks} landmarks": "{segments} Segmente, {landmarks} Landmarken",
    # decision and verdict
    "part number": "Teilenummer",
    "serial": "Seriennummer",
    "measured at": "gemessen am",
    "batch": "Charge",
    "order": "Auftrag",
    "machine": "Maschine",
    "operator": "Bediener",
    "gauge": "Messmittel",
    "design": "Soll",
    "scan": "Scan",
    "mesh": "Netz",
    "date": "Datum",
    "job": "Auftrag (Job)",
    "page": "Seite",
    "of": "von",
    "Warning": "Hinweis",
    "part": "Teil",
    "pass": "in Ordnung",
    "fail": "nicht in Ordnung",
    "not judged": "nicht bewertet",
    "passed": "erfüllt",
    "failed": "nicht erfüllt",
    "alignment": "Ausrichtung",
    "ok": "ok",
    "uncertain": "unsicher",
    "ambiguous": "mehrdeutig",
    "under constrained": "unterbestimmt",
    "units suspect": "Einheit fraglich",
    "mirrored": "gespiegelt",
    "no match": "passt nicht",
    "confidence": "Konfidenz",
    "0 to 1": "0 bis 1",
    "not given": "nicht angegeben",
    "Why": "Begründung:",
    "About the best rejected pose": "Zur besten verworfenen Lage",
    "The scan is aligned. This pose fits clearly better than any other.": (
        "Der Scan ist ausgerichtet. Diese Lage passt deutlich besser als jede andere."
    ),
    "The scan is aligned. The design is symmetric: its equivalent poses fit as well, and each is correct. "
    "Every other pose fits clearly worse.": (
        "Der Scan ist ausgerichtet. Das Soll ist symmetrisch: Seine gleichwertigen Lagen passen ebenso "
        "gut, und jede davon ist richtig. Jede andere Lage passt deutlich schlechter."
    ),
    "The scan is aligned, and this pose fits clearly better than any other, but it is not certain that the "
    "scan shows this part, undamaged and in this pose. The findings say why. Check the pose before you use "
    "it.": (
        "Der Scan ist ausgerichtet, und diese Lage passt deutlich besser als jede andere, aber es ist "
        "nicht sicher, dass der Scan dieses Teil zeigt, unbeschädigt und in dieser Lage. Die Befunde "
        "sagen, warum. Die Lage ist vor der Verwendung zu prüfen."
    ),
    "The scan does not show which pose is right: another one, or the mirror image, fits nearly as well, or "
    "the scan is flat. The findings say which. Check the pose before you use it.": (
        "Der Scan zeigt nicht, welche Lage richtig ist: Eine andere oder das Spiegelbild passt fast ebenso "
        "gut, oder der Scan ist eben. Die Befunde sagen, was zutrifft. Die Lage ist vor der Verwendung zu "
        "prüfen."
    ),
    "The scan can slide or turn on the design with hardly any change of the fit, so this motion of the "
    "pose is uncertain. The findings say which motion, and by how much.": (
        "Der Scan kann auf dem Soll gleiten oder sich drehen, fast ohne schlechter zu passen; diese "
        "Bewegung der Lage ist daher unsicher. Die Befunde sagen, welche und um wie viel."
    ),
    "The scan fits only in another unit of length. Send it again with the unit that the findings name "
    "(options.units).": (
        "Der Scan passt nur in einer anderen Längeneinheit. Er ist mit der Einheit, die die Befunde "
        "nennen, erneut zu senden (options.units)."
    ),
    "The scan is the mirror image of the design. No valid alignment was found, and no deviation is "
    "reported.": (
        "Der Scan ist das Spiegelbild des Solls. Es wurde keine gültige Ausrichtung gefunden; "
        "Abweichungen werden nicht angegeben."
    ),
    "No valid alignment was found, and no deviation is reported. The scan shows another part, too "
    "little of this one, or a failed print.": (
        "Es wurde keine gültige Ausrichtung gefunden; Abweichungen werden nicht angegeben. Der Scan "
        "zeigt ein anderes Teil, zu wenig von diesem oder einen Fehldruck."
    ),
    "Each probability follows from the sum of value times weight. The contribution compares a value "
    "with its typical value for right poses: above 0 it speaks for, below 0 against. The confidence "
    "is the product of both probabilities.": (
        "Jede Wahrscheinlichkeit folgt aus der Summe von Wert mal Gewicht. Der Beitrag vergleicht "
        "einen Wert mit dem typischen Wert richtiger Lagen: Über 0 spricht er dafür, unter 0 dagegen. "
        "Die Konfidenz ist das Produkt der beiden Wahrscheinlichkeiten."
    ),
    "evidence": "Beleg",
    "value": "Wert",
    "weight": "Gewicht",
    "contribution": "Beitrag",
    "what it measures": "was er misst",
    "neutral": "neutral",
    "for": "dafür",
    "against": "dagegen",
    "same part": "dasselbe Teil",
    "pose": "Lage",
    "probability that the scan is of this design": "Wahrscheinlichkeit, dass der Scan dieses Soll zeigt",
    "probability that the pose is right, if it is": "Wahrscheinlichkeit, dass die Lage dann richtig ist",
    # key figures
    "within tolerance": "in Toleranz",
    "within ±{size} mm": "innerhalb ±{size} mm",
    "no tolerance": "keine Toleranz",
    "mean": "Mittelwert",
    "coverage of the design": "Abdeckung des Solls",
    "size of the scan": "Größe des Scans",
    "scale to set in the slicer (not applied)": "Skalierung im Slicer (nicht angewandt)",
    "not determined": "nicht bestimmt",
    # checks and extremes
    "Checks": "Prüfungen",
    "check": "Prüfung",
    "standard error": "Standardfehler",
    "lower limit": "untere Grenze",
    "upper limit": "obere Grenze",
    "result": "Ergebnis",
    "at x, y, z (design), mm": "bei x, y, z (Soll), mm",
    "Decision rule": "Entscheidungsregel",
    "Largest deviations": "Größte Abweichungen",
    "deviation, mm": "Abweichung, mm",
    "standard error, mm": "Standardfehler, mm",
    "area, mm²": "Fläche, mm²",
    "segment": "Segment",
    "Area: the surface around it that deviates by at least half of this.": (
        "Fläche: die Umgebung, die um mindestens die Hälfte davon abweicht."
    ),
    "Medians over patches of {size} mm diameter; min and max are single vertices.": (
        "Mediane über Flecken von {size} mm Durchmesser; min und max sind einzelne Punkte."
    ),
    # pictures
    "Deviation of the scan from the design": "Abweichung des Scans vom Soll",
    "Not a measurement: the best of the rejected poses": ("Keine Messung: die beste der verworfenen Lagen"),
    "Where the scan lies off the design here may tell why the two do not fit.": (
        "Wo der Scan hier neben dem Soll liegt, kann zeigen, warum beide nicht passen."
    ),
    "distances of the scan, view": "Abstände des Scans, Ansicht",
    "{view}: shows the largest deviation": "{view}: zeigt die größte Abweichung",
    "oblique": "schräg",
    "colour legend of the deviation in mm": "Farblegende der Abweichung in mm",
    "Blue: material is missing. Red: excess material.": "Blau: Material fehlt. Rot: zu viel Material.",
    "Blue: below the surface of the design. Red: above it, on the side of its face normals.": (
        "Blau: unter der Fläche des Solls. Rot: darüber, auf der Seite seiner Flächennormalen."
    ),
    "Red: away from the design. Its faces have no consistent orientation, so distances have no sign.": (
        "Rot: vom Soll entfernt. Seine Flächen sind nicht einheitlich orientiert, daher haben Abstände "
        "kein Vorzeichen."
    ),
    "Blue: inside the design. Red: outside.": "Blau: innerhalb des Solls. Rot: außerhalb.",
    "Dark grey: on an open border, not counted.": "Dunkelgrau: an einem offenen Rand, nicht gezählt.",
    "Light grey: within ±{size} mm.": "Hellgrau: innerhalb ±{size} mm.",
    "Histogram of the deviation": "Histogramm der Abweichung",
    "median": "Median",
    "mean {mean} mm, SD {sd} mm, RMS {rms} mm": "Mittelwert {mean} mm, SD {sd} mm, RMS {rms} mm",
    "share of the area [%]": "Anteil der Fläche [%]",
    "deviation [mm]: &lt; 0 missing material, &gt; 0 excess material": (
        "Abweichung [mm]: &lt; 0 Material fehlt, &gt; 0 zu viel Material"
    ),
    "deviation [mm]: &lt; 0 below the surface of the design, &gt; 0 above it": (
        "Abweichung [mm]: &lt; 0 unter der Fläche des Solls, &gt; 0 darüber"
    ),
    "distance from the design [mm], without a sign": "Abstand vom Soll [mm], ohne Vorzeichen",
    "Cross-sections through min and max": "Schnitte durch min und max",
    "{value} mm, plane {axis} = {at} mm; deviation drawn {factor} times; black: design, coloured: scan": (
        "{value} mm, Ebene {axis} = {at} mm; Abweichung {factor}-fach gezeichnet; schwarz: Soll, farbig: Scan"
    ),
    "Segments and landmarks": "Segmente und Landmarken",
    "segments,": "Segmente,",
    "One colour a segment, halo paler; dots are landmarks.": (
        "Eine Farbe je Segment, sein Rand blasser; Punkte sind Landmarken."
    ),
    "Each mesh is numbered and coloured by itself.": "Jedes Netz ist für sich nummeriert und gefärbt.",
    "Decision graph": "Entscheidungsgraph",
    "Decision graphs": "Entscheidungsgraphen",
    "Result": "Ergebnis",
    # statistics
    "Deviation in both directions": "Abweichung in beiden Richtungen",
    "scan to design": "Scan zum Soll",
    "design to scan": "Soll zum Scan",
    "From the design to the scan it shows what is missing: a broken piece, or a filled hole.": (
        "Vom Soll zum Scan zeigt sie, was fehlt: ein abgebrochenes Stück oder ein gefülltes Loch."
    ),
    "The scan is a point cloud: from the design the distance is to the nearest point, so it includes the "
    "spacing of the points.": (
        "Der Scan ist eine Punktwolke: Vom Soll aus ist es der Abstand zum nächsten Punkt; er enthält daher "
        "den Abstand der Punkte voneinander."
    ),
    "share of the design that is counted": "Anteil des Solls, der gezählt ist",
    "vertices counted": "gezählte Punkte",
    "mean (SD)": "Mittelwert (SD)",
    "1 % to 99 % quantile": "1-%- bis 99-%-Quantil",
    "min to max": "min bis max",
    "to": "bis",
    "within, above, below the tolerance": "innerhalb, über, unter der Toleranz",
    "no tolerance was given": "keine Toleranz angegeben",
    "Deviation by segment of the design": "Abweichung nach Segmenten des Solls",
    "Of the scan's vertices, by area, by the segment of the nearest design point.": (
        "Der Punkte des Scans, nach Fläche, je Segment des nächsten Punkts des Solls."
    ),
    "vertices": "Punkte",
    "mean, mm": "Mittelwert, mm",
    "SD, mm": "SD, mm",
    "RMS, mm": "RMS, mm",
    "min, mm": "min, mm",
    "max, mm": "max, mm",
    # how it was found
    "How it was found": "Wie es ermittelt wurde",
    "{design} landmarks on the design, {scan} on the scan": (
        "{design} Landmarken auf dem Soll, {scan} auf dem Scan"
    ),
    "{passed} of {count} checks passed": "{passed} von {count} Prüfungen bestanden",
    "{count} matched": "{count} zugeordnet",
    "Design {design} along the axes of its file; scan{times} {scan} {where}.": (
        "Soll {design} entlang der Achsen seiner Datei; Scan{times} {scan} {where}."
    ),
    ", its numbers times {factor},": ", seine Zahlen mal {factor},",
    "along the same axes": "entlang derselben Achsen",
    "along the axes of its file": "entlang der Achsen seiner Datei",
    "Pose of the scan on the design": "Lage des Scans auf dem Soll",
    "translation, mm": "Verschiebung, mm",
    "{convention}: a rotation by {angle}° and a translation. results.json has it in full precision, "
    "and in the units of the files.": (
        "{convention}: eine Drehung um {angle}° und eine Verschiebung. results.json enthält sie mit "
        "allen Stellen und in den Einheiten der Dateien."
    ),
    "Registration": "Ausrichtung",
    "quantity": "Größe",
    "RMSE as uploaded": "RMSE wie gesendet",
    "RMSE of the landmark alignment": "RMSE der Ausrichtung nach Landmarken",
    "RMSE of ICP of the complete shape, without landmarks": "RMSE von ICP der ganzen Form, ohne Landmarken",
    "K, the ratio of the two": "K, das Verhältnis der beiden",
    "RMSE of the final pose": "RMSE der endgültigen Lage",
    "inlier distance": "Inlier-Abstand",
    "share of the scan within the inlier distance": "Anteil des Scans innerhalb des Inlier-Abstands",
    "the same, without open borders of the design": "dasselbe, ohne offene Ränder des Solls",
    "share of the design within the inlier distance of the scan": (
        "Anteil des Solls innerhalb des Inlier-Abstands vom Scan"
    ),
    "residual deformation": "verbleibende Verformung",
    "noise of the scan (1 sigma, from local surface fits)": (
        "Rauschen des Scans (1 Sigma, aus örtlichen Flächen)"
    ),
    "stated accuracy of the scanner (1 sigma)": "angegebene Genauigkeit des Scanners (1 Sigma)",
    "not stated": "nicht angegeben",
    "residual limit for the verdict ok": "Grenze der Restabweichung für das Urteil ok",
    "share of the scan left out as stray pieces": "Anteil des Scans, der als Streuteile weggelassen ist",
    "RMSE: area-weighted, over every vertex of the cleaned scan, without excluding outliers.": (
        "RMSE: nach Fläche gewichtet, über alle Punkte des bereinigten Scans, ohne Ausreißer auszuschließen."
    ),
    "Equivalent poses": "Gleichwertige Lagen",
    "{count} besides this one, by symmetry of the design: each is equally correct.": (
        "{count} außer dieser, durch die Symmetrie des Solls: Jede ist ebenso richtig."
    ),
    "Rejected poses": "Verworfene Lagen",
    "Alternative poses": "Andere Lagen",
    "A cost of 1 is as good as the best pose.": "Kosten von 1 sind so gut wie die der besten Lage.",
    "number": "Nummer",
    "cost over that of the best": "Kosten, bezogen auf die beste",
    "Segments": "Segmente",
    "rho of its centre": "Rho seines Zentrums",
    "delta, mm": "Delta, mm",
    "centre, mm": "Zentrum, mm",
    "Metric {metric}, density {density}, d_c {d_c} mm, halo {halo}.": (
        "Metrik {metric}, Dichte {density}, d_c {d_c} mm, Rand {halo}."
    ),
    "Landmarks": "Landmarken",
    "strength": "Stärke",
    "position, mm": "Position, mm",
    "vertex": "Punkt",
    "Strength: T² divided by its limit. The vertex numbers refer to mesh.clean.ply.": (
        "Stärke: T² durch seine Grenze. Die Punktnummern beziehen sich auf mesh.clean.ply."
    ),
    "Provenance": "Herkunft",
    "format": "Format",
    "unit": "Einheit",
    "Cusp {version}, seed {seed}. results.json lists all settings and library versions.": (
        "Cusp {version}, Startwert {seed}. results.json nennt alle Einstellungen und Versionen."
    ),
    # decision graphs
    "Decision graph of {mesh}: 1 segment by {method}": "Entscheidungsgraph, {mesh}: 1 Segment durch {method}",
    "Decision graph of {mesh}: {count} segments by {method}": (
        "Entscheidungsgraph, {mesh}: {count} Segmente durch {method}"
    ),
    "density peaks": "Dichtegipfel",
    "K-means": "K-Means",
    "fuzzy C-means": "Fuzzy-C-Means",
    "K-medians": "K-Medians",
    "K-centers": "K-Centers",
    "Gaussian mixture": "Gaußsche Mischung",
    "local density {rho}: vertices within {d_c}": "örtliche Dichte {rho}: Punkte innerhalb von {d_c}",
    "local density {rho}: surface area within {d_c} [mm²]": (
        "örtliche Dichte {rho}: Fläche innerhalb von {d_c} [mm²]"
    ),
    "local density {rho}: area around, weighted by its height on a bump [mm²]": (
        "örtliche Dichte {rho}: Fläche ringsum, nach der Höhe auf Höckern gewichtet [mm²]"
    ),
    "{delta}: distance along the surface": "{delta}: Abstand entlang der Fläche",
    "to the nearest denser vertex [mm]": "zum nächsten dichteren Punkt [mm]",
    "vertex of the halo (border of a segment)": "Punkt am Rand eines Segments (Halo)",
    "cut-off distance {d_c} = {size} mm": "Grenzabstand {d_c} = {size} mm",
    "density peak: centre of a segment, with its number and colour": (
        "Dichtegipfel: Zentrum eines Segments, mit Nummer und Farbe"
    ),
    "centre of a segment, with its number and colour": "Zentrum eines Segments, mit Nummer und Farbe",
}
