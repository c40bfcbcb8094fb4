from setuptools import find_packages, setup

package_name = 'traction_node'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', ['config/loopback.xml']),
    ],
    install_requires=['pyyaml'],
    extras_require={'test': ['hypothesis', 'pytest']},
    zip_safe=False,
    maintainer='Traction-control suite maintainers',
    maintainer_email='maintainers@traction-control-suite.org',
    description=(
        'How a node of the traction-control suite spins, declares parameters, '
        'reports its health and ends.'
    ),
    license='Apache-2.0',
    entry_points={'pytest11': ['traction_node = traction_node.pytest_plugin']},
)
