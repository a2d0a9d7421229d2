"""No module imports itself by a way around, not even for its types; the rooms themselves are import-linter's."""

import graphlib

import grimp


def test_no_imports_run_in_a_circle():
    graph = grimp.build_graph("rsibr", exclude_type_checking_imports=False)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    # A package imports its modules, and `rsibr` names its public functions, for the type checker alone
    names_only = {"rsibr", *(module for module in imports if any(one.startswith(f"{module}.") for one in imports))}
    modules = {module: found - names_only for module, found in imports.items() if module not in names_only}
    order = list(graphlib.TopologicalSorter(modules).static_order())  # raises CycleError
    assert len(order) > 150
