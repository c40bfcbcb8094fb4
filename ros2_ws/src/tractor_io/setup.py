from setuptools import find_packages, setup

package_name = 'tractor_io'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        (
            'share/' + package_name + '/config',
            [
                'config/can_bus.yaml',
                'config/import_rover.yaml',
                'config/import_t7165s.yaml',
                'config/tractor.dbc',
            ],
        ),
    ],
    install_requires=[
        'cantools',
        'lz4',
        'mcap>=1.6',
        'python-can',
        'pyyaml',
        'rosbags',
        'zstandard',
    ],
    extras_require={'test': ['hypothesis', 'pytest']},
    zip_safe=False,
    maintainer='Traction-control suite maintainers',
    maintainer_email='maintainers@traction-control-suite.org',
    description="Bags, player, recorder, and the bridge to a tractor's CAN bus.",
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'bag_player = tractor_io.bags.player_node:main',
            'can_bridge = tractor_io.can.bridge_node:main',
            'bag_recorder = tractor_io.bags.recorder_node:main',
            'tractor_ecu = tractor_io.can.ecu_node:main',
        ],
    },
)
