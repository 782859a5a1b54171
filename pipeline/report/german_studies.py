"""The German of the studies of landmark detectors. Keys are the English texts in the code."""

GERMAN_STUDIES: dict[str, str] = {
    "informativeness": "Aussagekraft",
    "repeatability": "Wiederholbarkeit",
    # informativeness, summary
    "In {trials} trials a copy of the shape was moved by up to {noise} mm along each axis{rotation}, then "
    "registered by ICP of all {points} points and by ICP of {landmarks} landmarks alone; K is the error "
    "of the former divided by that of the latter.": (
        "In {trials} Versuchen wurde eine Kopie der Form um bis zu {noise} mm entlang jeder Achse "
        "verschoben{rotation} und dann durch ICP aller {points} Punkte und durch ICP von {landmarks} "
        "Landmarken allein ausgerichtet; K ist der Fehler der ersten geteilt durch den der zweiten "
        "Ausrichtung."
    ),
    " and rotated by up to {angle} degrees": " und um bis zu {angle} Grad gedreht",
    "With either stopping rule of ICP": "Mit beiden Abbruchregeln von ICP",
    "With the stopping rule of the library": "Mit der Abbruchregel der Bibliothek",
    "With ICP to convergence": "Mit ICP bis zur Konvergenz",
    "{start}, every trial of every detector was a tie (both errors are rounding errors): the study cannot "
    "distinguish the detectors, nor landmarks from the complete shape.": (
        "{start} war jeder Versuch jedes Detektors unentschieden (beide Fehler sind Rundungsfehler): Die "
        "Studie kann weder die Detektoren unterscheiden noch Landmarken von der ganzen Form."
    ),
    "{start}, landmarks alone did better in this share of the trials: {better}; tied (both errors are "
    "rounding errors) in {tied}; and did worse in the rest.": (
        "{start} waren Landmarken allein in diesem Anteil der Versuche besser: {better}; unentschieden "
        "(beide Fehler sind Rundungsfehler) in {tied}; in den übrigen schlechter."
    ),
    "Better or tied more often than random points: {more}; less often: {less}; within {limit} standard "
    "errors: {alike}.": (
        "Öfter besser oder unentschieden als zufällige Punkte: {more}; seltener: {less}; innerhalb von "
        "{limit} Standardfehlern: {alike}."
    ),
    "Counted as in the paper, K > 1 for errors of any size, the share is {shares}": (
        "Wie in der Veröffentlichung gezählt, K > 1 für Fehler jeder Größe, beträgt der Anteil {shares}"
    ),
    "; in ties this compares rounding errors, which grow with the number of summed points for any choice "
    "of points": (
        "; bei unentschiedenen Versuchen vergleicht das Rundungsfehler, die mit der Zahl der summierten "
        "Punkte wachsen, wie auch immer die Punkte gewählt sind"
    ),
    "{share} with every detector": "{share} bei jedem Detektor",
    "none": "keiner",
    # informativeness, drawing
    "moved by up to {noise} mm": "verschoben um bis zu {noise} mm",
    ", rotated by up to {angle}°": ", gedreht um bis zu {angle}°",
    "Landmarks alone against the complete shape: {trials} trials, {moved}": (
        "Landmarken allein gegen die ganze Form: {trials} Versuche, {moved}"
    ),
    "ICP, stopping rule of the library": "ICP, Abbruchregel der Bibliothek",
    "ICP to convergence": "ICP bis zur Konvergenz",
    "every trial is a tie": "jeder Versuch ist unentschieden",
    "ties excluded; > 0: landmarks alone are better": (
        "ohne unentschiedene; > 0: Landmarken allein sind besser"
    ),
    "share of all trials up to K": "Anteil aller Versuche bis K",
    "share of trials in which landmarks alone are": "Anteil der Versuche; Landmarken allein:",
    "worse": "schlechter",
    "better": "besser",
    "tie (both exact up to rounding)": "unentschieden (beide bis auf Rundung genau)",
    # detectors
    "Gaussian curvature": "Gaußkrümmung",
    "average geodesic": "mittlere Geodäte",
    "heat kernel": "Wärmekern",
    "Gaussian process": "Gaußprozess",
    "farthest point": "fernste Punkte",
    "random": "zufällig",
    # repeatability
    "Repeatability of {count} points of each detector within {eps} of the diagonal ({eps_mm} mm), on a "
    "mesh with other triangles and {condition}: {listed}; the same number of random points reaches "
    "{chance} by chance. Highest: {best}{harder}; lowest: {worst}. The landmarks gave a pose within "
    "{right} of the diagonal for {poses} of {trials} trials.": (
        "Wiederholbarkeit von {count} Punkten jedes Detektors innerhalb von {eps} der Diagonale "
        "({eps_mm} mm), auf einem Netz mit anderen Dreiecken und {condition}: {listed}; ebenso viele "
        "zufällige Punkte erreichen {chance}. Am höchsten: {best}{harder}; am niedrigsten: {worst}. Die "
        "Landmarken ergaben eine Lage innerhalb von {right} der Diagonale: {poses} von {trials} Versuchen."
    ),
    "{mean} with {condition}": "{mean} mit {condition}",
    "{detector} in {share}": "{detector} in {share}",
    "noise {level:.2%}": "Rauschen {level}",
    "noise {level:.2%}, {crop:.0%} cut off": "Rauschen {level}, {crop} abgeschnitten",
    "random points, by chance": "zufällige Punkte",
    "share of {count} points found again within {eps_mm} mm ({eps} of the diagonal), mean of {trials} "
    "trials": (
        "Anteil der {count} Punkte, die innerhalb von {eps_mm} mm ({eps} der Diagonale) wiedergefunden "
        "wurden, Mittel aus {trials} Versuchen"
    ),
}
