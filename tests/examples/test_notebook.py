"""The example notebook runs from its first cell to its last one in a Jupyter kernel."""

import pytest
from user_folder import UserFolder

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")
pytest.importorskip("matplotlib")


def test_the_notebook_trains_deploys_and_plots(
    user_folder: UserFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    user_folder.copy("train_evaluate_deploy.ipynb")
    notebook = nbformat.read(user_folder.path / "train_evaluate_deploy.ipynb", as_version=4)
    nbformat.validate(notebook)
    (parameters,) = [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", ())]
    (user_folder.path / "quick.yaml").write_text("{base: smoke, ppo: {total_steps: 512}, env: {physics: c}}")
    parameters.source += '\npreset, episodes = "quick.yaml", 1'  # the values do not matter here
    for cell in notebook.cells:
        cell.source = cell.source.replace("duration_s=8.0", "duration_s=1.0")
    folder = str(user_folder.path)
    nbclient.NotebookClient(notebook, resources={"metadata": {"path": folder}}, timeout=600).execute()
    made = {"runs/notebook/policy.onnx", "walk.mcap", "walk.png"}
    assert all((user_folder.path / name).stat().st_size > 0 for name in made)
    training, evaluation, deployment = (cell for cell in notebook.cells[4:9] if cell.cell_type == "code")
    assert "policy.onnx" in text_of(training)
    assert "nominal" in text_of(evaluation)
    assert " m" in text_of(deployment)


def text_of(cell: "nbformat.NotebookNode") -> str:
    """Output and value of a cell."""
    texts = [output.get("text") or output.get("data", {}).get("text/plain", "") for output in cell.outputs]
    return "\n".join(texts)
