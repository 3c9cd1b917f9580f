"""XML from elsewhere: no document types, no entities, no surprise of any kind."""

from hypothesis import given
from hypothesis import strategies as st

from grammars.text.diagnostics import InputError
from tests.languages.roslaunch.launched import launch, parameters


def test_texts_in_other_letters_keep_their_places(tmp_path):
    text = (
        '<?xml version="1.0" encoding="ISO-8859-1"?>\n'
        '<launch><!-- größer -->\n<node pkg="amcl" type="amcl" name="amcl">\n'
        '<param name="ä" value = \'ö\' /><param name="b" value="1"/></node></launch>'
    )
    (tmp_path / "a.launch").write_text(text, encoding="utf-8")
    loaded = launch(tmp_path / "a.launch")
    assert parameters(loaded, "/amcl") == {"ä": "ö", "b": 1}
    assert [p.where.column for p in loaded.nodes[0].parameters.values()] == [26, 54]


@given(text=st.text(st.sampled_from("<>/ launchgroupinclude=\"'$()&;!?-[]\n\0ä"), max_size=60))
def test_any_text_is_read_or_refused(text, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / "any.launch"
    path.write_text(f"<launch>{text}</launch>", encoding="utf-8")
    try:
        launch(path)
    except InputError as error:
        assert all(one.where.file == str(path) for one in error.findings)
