from glob import glob

from setuptools import find_packages, setup

package_name = 'traction_bringup'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', sorted(glob('config/*.yaml'))),
        (
            'share/' + package_name + '/config/security',
            sorted(glob('config/security/*.xml')),
        ),
        ('share/' + package_name + '/launch', sorted(glob('launch/*.launch.py'))),
    ],
    install_requires=[
        'rich',
        'traction_controller',
        'traction_evaluation',
        'traction_model',
        'typer',
    ],
    extras_require={'test': ['pytest']},
    zip_safe=False,
    maintainer='Traction-control suite maintainers',
    maintainer_email='maintainers@traction-control-suite.org',
    description='The suite as a system: launch files, the drive cycle, and the traction command.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'drive_cycle = traction_bringup.nodes.drive_cycle:main',
            'traction = traction_bringup.command:main',
        ],
    },
)
