from setuptools import find_packages, setup

package_name = 'traction_model'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['presets/*.yaml', 'presets/vehicles/*.yaml', 'py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', ['config/plant.yaml']),
    ],
    install_requires=['numba', 'numpy', 'pydantic>=2', 'pyyaml', 'scipy'],
    # LpvModel.to_control; simulate_batch(device='gpu').
    extras_require={
        'test': ['hypothesis', 'psutil', 'pytest'],
        'control': ['control'],
        'gpu': ['numba-cuda[cu12]'],
    },
    zip_safe=False,
    maintainer='Traction-control suite maintainers',
    maintainer_email='maintainers@traction-control-suite.org',
    description='Terramechanics of wheels on soft soil, and the plant node that simulates them.',
    license='Apache-2.0',
    entry_points={'console_scripts': ['plant_node = traction_model.nodes.plant_node:main']},
)
