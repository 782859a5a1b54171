"""The German of warnings, by their code; what was read in a file stays in the words of `detail`."""

_LEFT_OUT = "Die Datei enthält, was keine Oberfläche des Teils ist; es wurde weggelassen"

GERMAN_NOTES: dict[str, str] = {
    "bodies_united": (
        "Körper, die sich berühren oder überlappen, wurden vereinigt; Wände dazwischen entfallen"
    ),
    "within_open_bodies": (
        "Dreiecke, die tief in einem anderen Körper mit kleinen Löchern liegen, wurden weggelassen"
    ),
    "bodies_not_united": (
        "Flächen des Solls treffen auf andere und sind nicht geschlossen; innere Wände können geblieben sein"
    ),
    "non_manifold": "Dreiecke an Kanten, die mehr als zwei Dreiecke gemeinsam haben, wurden entfernt",
    "turned_faces": "Falsch orientierte Dreiecke wurden umgedreht",
    "point_cloud": (
        "Der Scan ist eine Punktwolke; für die Analyse wurde eine Fläche rekonstruiert, gemessen wird an "
        "den Punkten"
    ),
    "many_components": "Das Netz hat mehrere getrennte Stücke; d_c ist der größte endliche Abstand",
    "left_out_of_3mf": _LEFT_OUT,
    "left_out_of_obj": _LEFT_OUT,
    "left_out_of_off": _LEFT_OUT,
    "left_out_of_gltf": _LEFT_OUT,
    "left_out_of_amf": _LEFT_OUT,
    "left_out_of_vtp": _LEFT_OUT,
    "left_out_of_step": "Die STEP-Datei verweist auf Teile in anderen Dateien, die nicht gesendet wurden",
    "step_surfaces": (
        "Die STEP-Datei hat Flächen, die keinen Körper begrenzen; sie wurden als Oberfläche des Teils gelesen"
    ),
    "step_open_solid": "Flächen eines Körpers der STEP-Datei waren nicht lesbar; sie fehlen im Soll",
    "step_hidden": "In der STEP-Datei ausgeblendete Körper wurden wie die anderen gelesen",
    "curved_triangles": "Laut AMF sind Dreiecke gekrümmt; sie wurden eben gelesen",
    "points_left_out": (
        "Punkte, die die LAS-Datei als Rauschen oder zurückgehalten kennzeichnet, wurden weggelassen"
    ),
    "unit_assumed": "Die LAS-Datei nennt keine Einheit; ihre Zahlen wurden als mm gelesen",
    "scanner_positions": "Die Scans der Datei wurden nach ihren Lagen in ein System gebracht",
    "stations_ignored": "Die Standorte des Scanners widersprechen jeder Lage; sie wurden nicht verwendet",
    "pose_without_rotation": (
        "Die Lage eines Scans hat eine Drehung aus Nullen; sie wurde als keine Drehung gelesen"
    ),
    "morph_ignored": "Die glTF-Datei hat Morph-Ziele; gelesen wurden die Positionen ohne sie",
    "skin_ignored": (
        "Die glTF-Datei hat ein Skelett ohne Gelenke oder Gewichte; gelesen wurden die Positionen des Netzes"
    ),
    "several_parts": "Die Datei hat mehrere Teile; alle wurden als eines gelesen",
    "design_part": "Gelesen wurde das Teil, das options.design_part nennt",
    "decimal_comma": "Zahlen mit Dezimalkomma wurden gelesen",
    "numbered_points": "Die erste Spalte der Punkte wurde als ihre Nummer gelesen",
    "lines_not_read": "Zeilen, die keine Punkte sind, wurden nicht gelesen",
    "unit_not_used": (
        "Der Kopf der Punkte nennt unterschiedliche oder unbekannte Einheiten; sie wurden nicht verwendet"
    ),
    "more_points_than_announced": "Die Datei hat mehr Punkte, als ihr Kopf nennt; alle wurden gelesen",
    "points_without_position": "Punkte ohne Position wurden weggelassen",
    "ptx_transform": "Die Transformation der PTX-Datei wurde auf ihre Punkte angewandt",
    "range_grid": "Ein Tiefenraster wurde als Dreiecke gelesen, ohne die über Sprünge der Tiefe",
    "gaussian_splats": "Die PLY-Datei enthält Gaussian Splats: Ihre Mittelpunkte wurden als Punkte gelesen",
    "faces_without_area": "Flächen mit weniger als drei Ecken wurden weggelassen",
    "other_elements": (
        "Die PLY-Datei hat Elemente, die weder Punkte noch Flächen sind; sie wurden nicht gelesen"
    ),
    "stl_count": (
        "Die STL-Datei nennt eine andere Zahl von Dreiecken, als sie hat; die vorhandenen wurden gelesen"
    ),
    "several_stl": "Mehrere STL-Dateien hintereinander wurden gelesen",
    "bytes_after_stl": "Bytes nach dem letzten Dreieck wurden nicht gelesen",
    "stray_component": "Stücke, die nicht zum Teil gehören, wurden weggelassen",
    "no_landmarks": "Keine Landmarken: Die Fläche hat auf der Skala der Merkmale kein Relief",
    "too_few_landmarks": "Detektoren mit zu wenigen Punkten wurden weggelassen",
    "halo_included": "Ohne die Randpunkte blieben zu wenige Landmarken; sie sind daher dabei",
    "no_three_mf": "aligned.3mf wurde nicht geschrieben: Der Scan ist eine Punktwolke",
    "no_pdf": "report.pdf wurde nicht geschrieben: Eine Bibliothek des Systems fehlt",
}
