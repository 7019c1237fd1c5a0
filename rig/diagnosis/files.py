"""Where a diagnosis is kept in its session, and under which names."""

FOLDER = "diagnosis"
RESULT = "diagnosis.json"
MODEL = "model.json"
TRUTH = "truth.txt"
PICTURES = ("simulation", "residuals", "evidence", "confusability")
