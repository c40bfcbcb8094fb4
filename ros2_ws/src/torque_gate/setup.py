from glob import glob

from setuptools import find_packages, setup

package_name = 'torque_gate'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', sorted(glob('config/*.yaml'))),
    ],
    install_requires=[],
    extras_require={'test': ['hypothesis', 'pytest']},
    zip_safe=False,
    maintainer='Traction-control suite maintainers',
    maintainer_email='maintainers@traction-control-suite.org',
    description='The last check of every wheel torque before the hardware.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': ['torque_gate = torque_gate.nodes.torque_gate:main'],
    },
)
