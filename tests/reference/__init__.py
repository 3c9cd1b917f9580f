"""Ortega et al. 2024 and the tools before it: our models against what was published.

``figures.json`` holds numbers read from the published files, so the tests that compare with it need
no file of others. The remaining tests read the files in the folder that ``SCENARIO_REFERENCE_DATA``
names:

- ``floorplans``, ``missions``, ``keyframes``, ``worlds``, ``maps``, ``jsonld``: the models of Parra
  et al. 2023 and Ortega et al. 2024, from https://github.com/secorolab;
- ``robots``, ``suts``: navigation packages of robots from their ROS repositories, in folders of
  their names;
- ``goldens``, ``acceptance``: what the published tool made of plans, and the inputs it takes.
"""
