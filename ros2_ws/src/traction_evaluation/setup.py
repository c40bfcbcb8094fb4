from glob import glob

from setuptools import find_packages, setup

package_name = 'traction_evaluation'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['py.typed', '*/*.template.md']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', sorted(glob('config/*.yaml'))),
    ],
    install_requires=[
        'matplotlib',
        'numpy',
        'pyarrow',
        'pyyaml',
        'rich',
        'rosbags',
        'scipy',
        'torque_gate',
        'traction_controller',
        'traction_model',
        'traction_node',
        'tractor_io',
    ],
    extras_require={'test': ['hypothesis', 'pytest'], 'cluster': ['dask', 'distributed']},
    zip_safe=False,
    maintainer='Traction-control suite maintainers',
    maintainer_email='maintainers@traction-control-suite.org',
    description='Closed loop, faults, verification, replay, golden files, and their reports.',
    license='Apache-2.0',
    entry_points={
        'pytest11': ['traction_replay = traction_evaluation.replay.pytest_plugin'],
    },
)
