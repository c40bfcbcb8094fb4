from glob import glob

from setuptools import find_packages, setup

package_name = 'traction_controller'

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
            ['config/slip_estimator.yaml', 'config/slip_controller.yaml'],
        ),
        ('share/' + package_name + '/config/gains', sorted(glob('config/gains/*.yaml'))),
    ],
    install_requires=['numpy', 'pydantic>=2', 'pyyaml', 'scipy', 'traction_model'],
    extras_require={'test': ['hypothesis', 'pytest'], 'synthesis': ['clarabel', 'cvxpy']},
    zip_safe=False,
    maintainer='Traction-control suite maintainers',
    maintainer_email='maintainers@traction-control-suite.org',
    description='Slip estimation and gain-scheduled slip control of wheels on soft soil.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'slip_estimator = traction_controller.nodes.slip_estimator:main',
            'slip_controller = traction_controller.nodes.slip_controller:main',
        ]
    },
)
